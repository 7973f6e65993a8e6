"""slipd in ROS 2, without ROS: messages as ROS 2 messages, live for viewers and nodes, and the arm's motion from ROS.

``conversion`` makes the messages, which ``slipctl serve foxglove`` and ``slipctl serve ros2`` send. What talks to DDS
needs the package cyclonedds (the extra ``ros2``): `arm_motion`, `dds`, `feeds`, `motion_advice` and `ros2_command`.
"""
