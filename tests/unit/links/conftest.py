"""Links to the devices of a rig."""

from device_links import links

__all__ = ["links"]
