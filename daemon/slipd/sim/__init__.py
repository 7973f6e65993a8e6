"""The virtual gripper: a scene with ground truth, and devices that speak real bytes."""
