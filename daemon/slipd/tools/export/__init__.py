"""Recordings as files that other programs open: ROS 2 bags, MCAP with JSON, CSV, Parquet, data sets for learning."""
