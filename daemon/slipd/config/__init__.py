"""The config of a rig: its keys and defaults, the checks, and the file it is read from."""

from slipd.config.checks import axes_of, device_options, in_newtons, stale_after_ns, transport_of
from slipd.config.files import load, parse, shipped
from slipd.config.model import (
    Bus,
    Config,
    Finger,
    Grasp,
    Gripper,
    Levels,
    Pad,
    Rates,
    Recording,
    Reflex,
    Requests,
    Stream,
    Wrench,
)

__all__ = [
    "Bus",
    "Config",
    "Finger",
    "Grasp",
    "Gripper",
    "Levels",
    "Pad",
    "Rates",
    "Recording",
    "Reflex",
    "Requests",
    "Stream",
    "Wrench",
    "axes_of",
    "device_options",
    "in_newtons",
    "load",
    "parse",
    "shipped",
    "stale_after_ns",
    "transport_of",
]
