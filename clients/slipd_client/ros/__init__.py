"""Messages of slipd as ROS 2 messages: types, their text for viewers, CDR bytes. Needs no ROS, and loads no NumPy."""
