"""One gripper: the grip gate and its rules, the grip policy, control, faults and the reflex; pure."""
