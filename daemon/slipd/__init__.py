"""slipd: slip warnings from force/torque and tactile fingers of a parallel-jaw gripper."""
