"""Messages of slipd as ROS 2 messages: types, their text for viewers, CDR bytes; and live for viewers like Foxglove.

Needs no ROS, and loads no NumPy.
"""
