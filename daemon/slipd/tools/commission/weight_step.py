"""Step 2 of the guide: the person holds the gripper in a few poses, and the weight of each finger follows."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from slipd.config import Config, Wrench
from slipd.errors import SlipdError
from slipd.signals.gravity import STANDARD_GRAVITY_MPS2
from slipd.signals.tare import most_std
from slipd.tools.commission.dialogue import AGAIN, GO_ON, SKIP, Prompt, Say, Steps, choose
from slipd.tools.commission.readings import ReadingListener, read_status
from slipd.tools.commission.touches import Mount, mount_of
from slipd.tools.commission.weighing_search import Pose, WeightFindings, find_weight
from slipd.tools.commission.weight_identification import MIN_POSES
from slipd.types.arrays import Array
from slipd_client.errors import CallError
from slipd_client.gravity_feed import parse_gravity

POSES = {
    "tips_down": ("the fingertips point straight down", (1.0, 0.0, 0.0)),
    "pad_up": ("the fingers lie level, and the {finger} pad faces up", (0.0, 0.0, -1.0)),
    "pad_down": ("the fingers lie level, and the {finger} pad faces down", (0.0, 0.0, 1.0)),
    "side_down": ("the fingers lie level, and the +Y side of the {finger} pad points down", (0.0, 1.0, 0.0)),
}
"""Words of each pose, and the direction of gravity in the frame of the named pad."""

SIZE_TOLERANCE = 0.05
"""Largest relative error of the size of gravity that is typed."""

MIRROR = np.array((1.0, -1.0, -1.0))
"""Axes of the other finger: both X point to the fingertips, and the pads face each other."""

HOLD_S = 1.0
MOST_TRIES = 30
"""How often a finger may move, each time for HOLD_S, before the guide asks what is wrong."""

MOST_REPEATS = 4
"""How often a pose that does not fit may be repeated: then something else is wrong."""

READY, NOT_POSSIBLE = "ready", "not possible"
FREE = "gravity in the frame of the {finger} pad (x y z) or the orientation of that pad (quaternion x y z w)"


def weigh(rig: Config, mounts: Mapping[str, Mount], fingers: Sequence[str]) -> Steps[dict[str, WeightFindings]]:
    """Lead through the poses; return what they show of each finger.

    Args:
        rig: The config that the daemon runs.
        mounts: Mounting of each force sensor, as found.
        fingers: Names of the fingers with a force sensor; in the poses, the first one is named.

    Raises:
        Skipped: The person left the step out.
        SlipdError: The daemon is silent, or another program sends gravity.
    """
    yield from _check_no_gravity(fingers)
    yield Say("Take everything off the fingers. Nothing may touch them until the end of this step.")
    poses: dict[str, Mapping[str, Pose]] = {}
    for step in POSES:
        yield from _take_pose(step, rig, fingers, poses)
    for _ in range(MOST_REPEATS):
        findings = _findings(poses, mounts, fingers)
        worst = _worst(poses, findings)
        if worst is None or not (yield from _agree(worst, findings, fingers[0])):
            return findings
        yield from _take_pose(worst, rig, fingers, poses)
    return _findings(poses, mounts, fingers)


def _take_pose(step: str, rig: Config, fingers: Sequence[str], poses: dict[str, Mapping[str, Pose]]) -> Steps[None]:
    """Ask for a pose, and put what each finger reads into ``poses``; take it out if the arm cannot take it."""
    poses.pop(step, None)
    words, down = POSES[step]
    number = list(POSES).index(step) + 1
    text = f"Pose {number} of {len(POSES)}: turn the gripper so that {words.format(finger=fingers[0])}; hold still."
    prompt = Prompt(step, text, fingers[0], (READY, NOT_POSSIBLE, SKIP), FREE.format(finger=fingers[0]))
    gravity = yield from _gravity(prompt, down)
    if gravity is None:
        return
    wrenches = yield from _still(rig, fingers)
    taken: dict[str, Pose] = {}
    for index, name in enumerate(fingers):
        matrix = mount_of(_sensor(rig, name)).matrix
        raw = np.asarray(np.linalg.solve(matrix, wrenches[name]), dtype=np.float64)
        taken[name] = Pose(raw[:3], raw[3:], gravity if index == 0 else gravity * MIRROR)
    poses[step] = taken


def _findings(
    poses: Mapping[str, Mapping[str, Pose]], mounts: Mapping[str, Mount], fingers: Sequence[str]
) -> dict[str, WeightFindings]:
    if len(poses) < MIN_POSES:
        few = f"at least {MIN_POSES} poses are needed, got {len(poses)}"
        return {name: WeightFindings(problems=[few]) for name in fingers}
    return {name: find_weight([taken[name] for taken in poses.values()], mounts[name]) for name in fingers}


def _worst(poses: Mapping[str, Mapping[str, Pose]], findings: Mapping[str, WeightFindings]) -> str | None:
    """Return the pose whose readings do not fit the weight of a finger; None if all fit."""
    numbers = [each.worst for each in findings.values() if each.worst is not None]
    return list(poses)[numbers[0]] if numbers else None


def _agree(step: str, findings: Mapping[str, WeightFindings], finger: str) -> Steps[bool]:
    """Name the problems, and return whether the person repeats the pose."""
    yield from (Say(f"  {name}: {problem}") for name, each in findings.items() for problem in each.problems)
    words = POSES[step][0].format(finger=finger)
    text = f"All poses fit a weight but one, in which {words}. Only that one will be asked for again."
    return (yield from choose(Prompt("pose_again", text, finger, (AGAIN, GO_ON, SKIP)))) == AGAIN


def _check_no_gravity(fingers: Sequence[str]) -> Steps[None]:
    """Raise if the daemon subtracts a weight that changes with the pose."""
    status = yield from read_status()
    for name in fingers:
        stream = status.streams.get(f"{name}.wrench")
        if stream is not None and stream.gravity == "compensated":
            raise SlipdError(
                f"another program sends the direction of gravity for finger {name} (gravity.set or an arm stream), and "
                "the daemon subtracts the weight; stop it, or weigh from a recording: slipd identify"
            )


def _gravity(prompt: Prompt, down: Sequence[float]) -> Steps[Array | None]:
    """Return gravity in the frame of the first pad as asked for or as typed; None if the pose is not possible."""
    while True:
        word = yield from choose(prompt)
        if word == READY:
            return np.array(down) * STANDARD_GRAVITY_MPS2
        if word == NOT_POSSIBLE:
            return None
        try:
            return _at_rest(parse_gravity(word))
        except CallError as error:
            yield Say(f"  {error}. Or choose: {', '.join(prompt.choices)}")


def _at_rest(vector: Sequence[float]) -> Array:
    """Return gravity from a vector of its size, m/s², or of size 1.

    Raises:
        CallError: The vector has another size: a gripper that is held still feels nothing but gravity.
    """
    size = math.hypot(*vector)
    for usual, scale in ((STANDARD_GRAVITY_MPS2, 1.0), (1.0, STANDARD_GRAVITY_MPS2)):
        if abs(size - usual) <= SIZE_TOLERANCE * usual:
            return scale * np.array(vector)
    raise CallError(f"gravity must be about 9.81 m/s² in size, or 1 for its direction alone, got {size:.4g}")


def _still(rig: Config, fingers: Sequence[str]) -> Steps[dict[str, Array]]:
    """Return the mean wrench of each finger in the pad frame while they are still."""
    listener = ReadingListener(fingers, rig.config_id)
    yield from listener.leave_out_earlier()
    tries = 0
    while True:
        held = yield from listener.collect(HOLD_S)
        moved = [text for name in fingers if (text := _motion(_sensor(rig, name), np.array(held[name].wrenches), name))]
        if not moved:
            return {name: held[name].wrench for name in fingers}
        tries += 1
        yield Say(f"  {'; '.join(moved)}: hold it still")
        if tries % MOST_TRIES == 0:
            text = (
                f"The readings were not at rest in {MOST_TRIES} tries. Hold the gripper still, away from machines that "
                "shake. If it is still, force_std_n in the config is less than the noise of the sensor."
            )
            yield from choose(Prompt("still_again", text, fingers[0], (AGAIN, SKIP)))


def _motion(sensor: Wrench, wrenches: Array, name: str) -> str:
    """Return how the force of a finger changed, for people; "" at rest."""
    most_n = most_std(np.full(3, sensor.force_std_n))[0]
    std_n = float(wrenches.std(axis=0)[:3].max())
    return "" if std_n <= most_n else f"the force of finger {name} changes by {std_n:.2g} N, more than {most_n:.2g} N"


def _sensor(rig: Config, name: str) -> Wrench:
    sensor = rig.finger[name].wrench
    assert sensor is not None  # noqa: S101 - the caller names fingers with a force sensor
    return sensor
