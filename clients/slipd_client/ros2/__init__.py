"""``slipctl serve ros2``: messages as ROS 2 topics over DDS, and the arm's motion from ROS. Needs no ROS.

Only `dds`, `arm_sources`, `arm_feed` and `ros2_command` import cyclonedds, the extra ``ros2``.
"""
