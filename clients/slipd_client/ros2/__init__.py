"""``slipctl serve ros2``: messages as ROS 2 topics over DDS, and the arm's orientation from ROS. Needs no ROS.

Only `dds_types`, `ros_publisher` and `orientation_feed` import cyclonedds, the extra ``ros2``.
"""
