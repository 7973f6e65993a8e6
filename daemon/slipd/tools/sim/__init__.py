"""The virtual gripper: a scene with ground truth, and emulated devices that send real bytes."""
