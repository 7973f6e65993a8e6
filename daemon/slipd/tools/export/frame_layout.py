"""What a frame of a data set for learning holds, and where in the messages of slipd each number is."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from slipd.config import Config
from slipd_client.messages import GRIPPER_TOPIC, level_code, slip_topic, tactile_topic, wrench_topic

STATE = "observation.state"
LEVEL = "observation.level"
TACTILE = "observation.tactile."
AGE = "observation.age_s"
ACTION = "action"

UNKNOWN_LEVEL = level_code("unknown")
"""Level of a finger before its first verdict, and where the recording has a gap."""

_AXES = ("x", "y", "z")


@dataclass(frozen=True, slots=True)
class Feature:
    """Numbers of one kind in every frame.

    Attributes:
        name: Its key.
        names: Name of each number.
        whole: They are integers, not 32-bit floats.
    """

    name: str
    names: tuple[str, ...]
    whole: bool = False

    @property
    def dtype(self) -> str:
        """Name of their NumPy type."""
        return "int64" if self.whole else "float32"


class Tap(NamedTuple):
    """Where the numbers of one key of a message go.

    Attributes:
        feature: Name of the feature.
        begin: Place of the first number in it.
        end: Place after the last one.
        key: Key in the message.
    """

    feature: str
    begin: int
    end: int
    key: str


@dataclass(frozen=True, slots=True)
class FrameLayout:
    """The features of a rig.

    Attributes:
        features: In their order.
        taps: By topic.
        pads: Rows and columns of each pad, by the name of its feature.
    """

    features: tuple[Feature, ...]
    taps: dict[str, tuple[Tap, ...]]
    pads: dict[str, tuple[int, int]]


def frame_layout(settings: Config) -> FrameLayout:
    """Return the features of the rig of a config."""
    names: dict[str, list[str]] = {STATE: [], LEVEL: []}
    taps: dict[str, tuple[Tap, ...]] = {}
    pads: dict[str, tuple[int, int]] = {}

    def add(topic: str, feature: str, key: str, *of_numbers: str) -> None:
        found = names.setdefault(feature, [])
        tap = Tap(feature, len(found), len(found) + len(of_numbers), key)
        taps[topic] = (*taps.get(topic, ()), tap)
        found.extend(of_numbers)

    for finger, sensors in settings.finger.items():
        slip, wrench = slip_topic(finger), wrench_topic(finger)
        for key in ("force_n", "torque_nm"):
            add(wrench, STATE, key, *(f"{finger}.{key}.{axis}" for axis in _AXES))
        for key in ("utilisation", "grip_needed_n"):
            add(slip, STATE, key, f"{finger}.{key}")
        add(slip, LEVEL, "level_code", finger)
        if sensors.pad is not None:
            rows, cols = pads[TACTILE + finger] = (sensors.pad.rows, sensors.pad.cols)
            taxels = (f"row{row}.col{col}" for row in range(rows) for col in range(cols))
            add(tactile_topic(finger), TACTILE + finger, "loads_n", *taxels)
    if settings.gripper is not None:
        for key in ("width_m", "force_n"):
            add(GRIPPER_TOPIC, STATE, key, f"gripper.{key}")
        add(GRIPPER_TOPIC, ACTION, "force_command_n", "grip_force_n")
    names[AGE] = list(taps)
    features = tuple(Feature(name, tuple(found), name == LEVEL) for name, found in names.items())
    return FrameLayout(features, taps, pads)
