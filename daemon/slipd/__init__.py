"""slipd: slip warnings from force/torque and tactile fingers of a parallel-jaw gripper."""

__version__ = "0.1.0"
