"""The config of a rig: its keys with units and defaults, the checks, and the file that it is read from.

The keys of a table and their defaults are in the file named after it: ``finger_model`` ([finger.X] with wrench, pad and
slip), ``gripper_model`` ([gripper], [grasp], [reflex]), ``levels_model`` ([levels], [rates]), ``bus_model`` ([bus],
[requests]), ``recording_model`` ([recording]), ``host_model`` ([realtime], [restart]), and ``stream_model`` for the
keys that every device has. ``value_bounds`` has the range of each quantity.
"""

from slipd.config.bus_model import Bus, Requests
from slipd.config.check_hints import hints
from slipd.config.config_file import load, parse
from slipd.config.finger_model import Finger, Pad, Pose, Slip, Wrench
from slipd.config.gripper_model import Grasp, Gripper, ObservedObject, PadPlace, Reflex
from slipd.config.host_model import Realtime, Restart
from slipd.config.levels_model import Levels, Rates
from slipd.config.model import Config
from slipd.config.recording_model import Continuous, Incidents, Recording
from slipd.config.shipped_files import config_file as shipped
from slipd.config.stream_model import Stream
from slipd.config.stream_settings import axes_of, device_options, in_newtons, stale_after_ns, transport_of

__all__ = [
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
    "axes_of",
    "device_options",
    "hints",
    "in_newtons",
    "load",
    "parse",
    "shipped",
    "stale_after_ns",
    "transport_of",
]
