"""The config of a rig: its keys with units and defaults, the checks, and the file that it is read from.

The keys of a table and their defaults are in ``stream_tables`` ([finger.X] with wrench, pad and slip, and the keys of
every device), ``model`` ([gripper], [grasp], [reflex]) and ``service_tables`` (all others). ``value_bounds``
has the range of each quantity.
"""

from slipd.config.check_hints import hints
from slipd.config.checks import missing_keys
from slipd.config.config_file import load, parse
from slipd.config.model import (
    Arm,
    Config,
    Grasp,
    GraspMotion,
    Gripper,
    ObservedObject,
    PadPlace,
    Reflex,
    axes_of,
    device_options,
    in_newtons,
    stale_after_ns,
    transport_of,
)
from slipd.config.service_tables import (
    Bus,
    Continuous,
    Incidents,
    Levels,
    Rates,
    Realtime,
    Recording,
    Requests,
    Restart,
)
from slipd.config.stream_checks import address_fault
from slipd.config.stream_tables import Finger, Pad, Pose, Slip, Stream, Wrench

__all__ = [
    "Arm",
    "Bus",
    "Config",
    "Continuous",
    "Finger",
    "Grasp",
    "GraspMotion",
    "Gripper",
    "Incidents",
    "Levels",
    "ObservedObject",
    "Pad",
    "PadPlace",
    "Pose",
    "Rates",
    "Realtime",
    "Recording",
    "Reflex",
    "Requests",
    "Restart",
    "Slip",
    "Stream",
    "Wrench",
    "address_fault",
    "axes_of",
    "device_options",
    "hints",
    "in_newtons",
    "load",
    "missing_keys",
    "parse",
    "stale_after_ns",
    "transport_of",
]
