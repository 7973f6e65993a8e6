"""The config of a rig: its keys with units and defaults, the checks, and the file that it is read from.

The keys of a table and their defaults are in ``stream_tables`` ([finger.X] with wrench, pad and slip, and the keys of
every device), ``model`` ([gripper], [grasp], [reflex]) and ``service_tables`` (all others). ``value_bounds``
has the range of each quantity.
"""

from slipd.config.check_hints import hints
from slipd.config.config_file import load, parse
from slipd.config.model import (
    Arm,
    Config,
    Grasp,
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
)
from slipd.config.stream_tables import Finger, Pad, Slip, Stream, Wrench

__all__ = [
    "Arm",
    "Bus",
    "Config",
    "Continuous",
    "Finger",
    "Grasp",
    "Gripper",
    "Incidents",
    "Levels",
    "ObservedObject",
    "Pad",
    "PadPlace",
    "Rates",
    "Reflex",
    "Slip",
    "Stream",
    "Wrench",
    "axes_of",
    "device_options",
    "hints",
    "in_newtons",
    "load",
    "parse",
    "stale_after_ns",
    "transport_of",
]
