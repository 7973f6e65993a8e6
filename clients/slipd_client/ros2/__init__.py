"""``slipctl serve ros2``: messages as ROS 2 topics over DDS, and the arm's motion from ROS. Needs no ROS.

The modules that talk to DDS need cyclonedds, the extra ``ros2``.
"""
