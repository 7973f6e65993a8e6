"""Step 1 of the guide: leads a person through presses and pushes, from which the mounting of the sensors follows.

It only reads what the daemon publishes: nothing is set, and nothing moves.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from slipd.config import Config
from slipd.config.check_hints import needs_of
from slipd.tools.commission.dialogue import AGAIN, GO_ON, SKIP, Prompt, Say, Steps, choose
from slipd.tools.commission.mounting_search import find_mounting
from slipd.tools.commission.readings import FingerReadings, ReadingListener, noise_at_rest, pause
from slipd.tools.commission.touches import (
    CENTRE,
    NAMES,
    PUSHES,
    TEXTS,
    Findings,
    Noise,
    Touch,
    find_three_axis,
    mount_of,
    scan_centroid,
)
from slipd.types.arrays import Array

TOUCH_N = 1.5
"""Force that counts as a touch, N; a person presses with some newtons."""

RELEASE_SHARE = 0.5
REST_S, SETTLE_S, HOLD_S = 0.5, 0.3, 0.6
RECOVERY_TAUS = 1.5
"""Time between two touches in leak time constants of a charge pad, which keeps some of a touch until then."""

STEADY = 0.3
"""Largest relative change of the force and of the image within HOLD_S."""

LEAST_IMAGES = 3
NOISE_STD = 4.0
"""Standard deviations by which the sum of an image that is held still may change."""

MOST_TRIES = 20
"""How often a touch may move before the guide asks what is wrong."""

ASKED_N, MOST_PRESS_N = 5.0, 30.0
"""Force that a press is asked for, and the most that a fingertip then presses with, N."""

MOST_REPEATS = 3
"""How often touches that do not fit may be repeated: then something else is wrong."""

PUSH_SHARE = 0.2
"""Least tangential force of a push, as a share of the force of the press at the centre."""

OTHER_SHARE = 0.2
"""A finger that feels less than this share of the other one was not the one that was pressed."""


class TouchGuide:
    """Asks for touches, and reports what they show.

    Args:
        rig: The config that the daemon runs.
        listener: Its readings.
        patience_s: How long to wait for each touch, s.
    """

    def __init__(self, rig: Config, listener: ReadingListener, patience_s: float) -> None:
        self._rig, self._listener, self._patience_s = rig, listener, patience_s
        taus_s = (finger.pad.charge_tau_s for finger in rig.finger.values() if finger.pad is not None)
        self._recovery_s = RECOVERY_TAUS * max((tau_s or 0.0 for tau_s in taus_s), default=0.0)
        self._rest: dict[str, FingerReadings] = {}
        self._noise: dict[str, FingerReadings] | None = None

    def run(self, finger: str, pushes: Mapping[str, Touch] | None = None) -> Steps[Findings]:
        """Lead through all touches of one finger.

        Args:
            finger: Its name.
            pushes: Pushes of an earlier run, which are not asked for again.

        Raises:
            Skipped: The person left the finger out.
            SlipdError: The daemon fell silent.
        """
        self._rest, self._noise = {}, None
        touches = dict(pushes or {})
        streams: dict[str, str] = {}
        asked: Sequence[str] = [step for step in TEXTS if step not in touches]
        repeats = 0
        while True:
            yield from self._ask(finger, asked, touches, streams)
            findings = self._findings(finger, streams, touches)
            asked = [step for step in TEXTS if step in findings.doubtful]
            if not asked or repeats == MOST_REPEATS or not (yield from _agree(finger, findings)):
                return findings
            repeats += 1

    def _ask(
        self, finger: str, steps: Sequence[str], touches: dict[str, Touch], streams: dict[str, str]
    ) -> Steps[None]:
        """Ask for touches; add them to ``touches``, and the sensors that felt the first of all to ``streams``."""
        yield Say("Touch nothing.")
        for step in steps:
            self._rest = yield from self._rest_of_free_pads(finger, self._recovery_s if touches else 0.0)
            self._noise = self._noise or self._rest
            prompt = Prompt(step, TEXTS[step].format(finger=finger), finger)
            yield prompt
            held = yield from self._hold(prompt, touches.get(CENTRE), streams.get("wrench", ""))
            if not streams:
                streams.update(self._streams(finger, held))
            touches[step] = self._touch(held, streams)
            yield Say(f"  {NAMES[step]}: {np.linalg.norm(touches[step].force):.1f} N. Let go.")
            while not (yield from self._listener.wait(self._released, self._patience_s)):
                yield from self._wait_for_release(finger)
            if step == CENTRE and self._scale_remark(streams["wrench"], touches[step]):
                return  # the other touches would show nothing

    def _rest_of_free_pads(self, finger: str, recovery_s: float) -> Steps[dict[str, FingerReadings]]:
        """Return the readings of free pads; a touch that comes before it is asked for must end first."""
        while True:
            yield from pause(recovery_s)
            rest = yield from self._listener.collect(REST_S)
            if not self._rest or self._released({name: each.wrench for name, each in rest.items()}):
                return rest
            yield Say("  That was too early. Let go, and touch nothing until you are asked.")
            if not (yield from self._listener.wait(self._released, self._patience_s)):
                yield from self._wait_for_release(finger)
                self._rest = {}  # the gripper was turned, and its fingers weigh on the sensors

    def _findings(self, finger: str, streams: dict[str, str], touches: dict[str, Touch]) -> Findings:
        settings = self._rig.finger[finger]
        if remark := self._scale_remark(streams["wrench"], touches[CENTRE]):
            return Findings(streams=streams, problems=[remark], wrong_scale=True)
        if settings.wrench is None:
            findings = find_three_axis(touches)
        else:
            findings = find_mounting(touches, mount_of(settings.wrench), has_pad=settings.pad is not None)
        findings.notes += [
            f"the {kind} of finger {other} is on this finger" for kind, other in streams.items() if other != finger
        ]
        findings.streams, findings.touches = streams, touches
        findings.noise = self._noise_of(streams, findings)
        return findings

    def _noise_of(self, streams: Mapping[str, str], findings: Findings) -> Noise | None:
        """Return the noise of a finger before its first touch; add it to the notes."""
        stream = streams["wrench"]
        sensor, rest = self._rig.finger[stream].wrench, self._noise
        if sensor is None or rest is None or findings.mount is None:
            return None
        noise = noise_at_rest(rest[stream], mount_of(sensor), findings.mount)
        if noise is None:
            findings.notes.append("the noise is not measured: the readings moved, or did not change at all")
            return None
        taxels = "" if noise.threshold is None else f", ten times that of a taxel {noise.threshold:.2g}"
        findings.notes.append(f"noise at rest {noise.force_std_n:.2g} N, {noise.torque_std_nm:.2g} N·m{taxels}")
        return noise

    def _scale_remark(self, stream: str, centre: Touch) -> str:
        """Return why the force of a press cannot be right, and which keys may be wrong; "" if it can be right."""
        sensor = self._rig.finger[stream].wrench
        force_n = float(np.linalg.norm(centre.force))
        if sensor is None or force_n <= MOST_PRESS_N:
            return ""
        suspects = [need.key for need in needs_of(sensor) if need.scales] or ["a gain or unit of the sensor"]
        asked = f"you were asked for about {ASKED_N:g} N and the sensor reads {force_n:.0f} N"
        return f"{asked}: {', '.join(suspects)}? The mounting of this finger is left open; correct it, and begin again"

    def _hold(self, prompt: Prompt, centre: Touch | None, stream: str) -> Steps[dict[str, FingerReadings]]:
        """Wait for a touch that is held still, and return the readings while it is."""
        step = prompt.step

        def touched(newest: dict[str, Array]) -> bool:
            if self._largest_n(newest) < TOUCH_N:
                return False
            if step not in PUSHES or centre is None:
                return True
            force = self._raw(stream, newest[stream])[:3] - self._raw(stream, self._rest[stream].wrench)[:3]
            into = centre.force / np.linalg.norm(centre.force)
            along = force - into * (into @ force)
            return bool(np.linalg.norm(along) > PUSH_SHARE * np.linalg.norm(force))

        what = "push" if step in PUSHES else "press"
        tries = 0
        while True:
            while not (yield from self._listener.wait(touched, self._patience_s)):
                yield from _wait_longer(f"No {what} was felt within {self._patience_s:g} s.", prompt.finger)
                yield prompt
            yield from self._listener.collect(SETTLE_S)
            held = yield from self._listener.collect(HOLD_S)
            if not (moved := self._what_moved(held)):
                return held
            yield Say(f"  {moved}: hold it still")
            tries += 1
            if tries % MOST_TRIES == 0:
                yield from _wait_longer(f"The {what} was not held still in {MOST_TRIES} tries: {moved}.", prompt.finger)
                yield prompt

    def _what_moved(self, held: dict[str, FingerReadings]) -> str:
        """Return what changed during a touch, for people; "" if it was held still."""
        pressed = max(held, key=lambda name: self._felt_n(name, held))
        forces = np.array(held[pressed].wrenches)[:, :3] - self._rest[pressed].wrench[:3]
        sizes = np.linalg.norm(forces, axis=1)
        if sizes.min() > TOUCH_N / 2 and np.ptp(sizes) < max(STEADY * sizes.mean(), TOUCH_N / 2):
            changes = ((name, _image_change(self._rest[name], held[name])) for name in held)
            return "; ".join(f"the image of finger {name} {change}" for name, change in changes if change)
        return f"the force changed between {sizes.min():.1f} and {sizes.max():.1f} N"

    def _wait_for_release(self, finger: str) -> Steps[None]:
        yield from _wait_longer(f"The pads were not released within {self._patience_s:g} s.", finger)

    def _released(self, newest: dict[str, Array]) -> bool:
        return self._largest_n(newest) < RELEASE_SHARE * TOUCH_N

    def _largest_n(self, newest: dict[str, Array]) -> float:
        """Return the largest change of force on a finger since the pads were free, N."""
        rest = self._rest
        return max(float(np.linalg.norm(each[:3] - rest[name].wrench[:3])) for name, each in newest.items())

    def _felt_n(self, name: str, held: dict[str, FingerReadings]) -> float:
        """Return by how much force a finger was touched, N."""
        return float(np.linalg.norm(held[name].wrench[:3] - self._rest[name].wrench[:3]))

    def _streams(self, finger: str, held: dict[str, FingerReadings]) -> dict[str, str]:
        """Return the fingers in whose tables the sensors of the pressed finger are."""
        by_force = max(held, key=lambda name: self._felt_n(name, held))
        if self._felt_n(finger, held) > OTHER_SHARE * self._felt_n(by_force, held):
            by_force = finger
        images = {name: change.sum() for name in held if (change := self._image(name, held)) is not None}
        by_image = max(images, key=lambda name: images[name]) if images and max(images.values()) > 0.0 else by_force
        if images.get(finger, 0.0) > OTHER_SHARE * images.get(by_image, 0.0):
            by_image = finger
        return {"wrench": by_force, "pad": by_image}

    def _image(self, name: str, held: dict[str, FingerReadings]) -> Array | None:
        """Return the change of the image of a finger, at least 0; None without an image."""
        image, rest = held[name].image, self._rest[name].image
        return None if image is None else np.clip(image - (0.0 if rest is None else rest), 0.0, None)

    def _touch(self, held: dict[str, FingerReadings], streams: dict[str, str]) -> Touch:
        name, pad_name = streams["wrench"], streams["pad"]
        raw = self._raw(name, held[name].wrench) - self._raw(name, self._rest[name].wrench)
        pad, image = self._rig.finger[pad_name].pad, self._image(pad_name, held)
        scan_m = None if pad is None or image is None else scan_centroid(pad, image)
        return Touch(raw[:3], raw[3:], scan_m)

    def _raw(self, name: str, wrench: Array) -> Array:
        """Return what the sensor read for a published wrench: its own frame, without sign."""
        settings = self._rig.finger[name]
        if settings.wrench is not None:
            return np.asarray(np.linalg.solve(mount_of(settings.wrench).matrix, wrench))
        pad = settings.pad
        assert pad is not None  # noqa: S101 - a finger has a force sensor or a pad
        force = wrench[:3] * np.sign(pad.axis_scale)
        return np.concatenate((force[[1, 0, 2]] if pad.swap_xy else force, wrench[3:]))


def _wait_longer(why: str, finger: str) -> Steps[None]:
    """Ask whether to wait longer; SKIP leaves out this finger alone."""
    text = f"{why} Try again, or leave finger {finger} out; what was found of the others is kept."
    yield from choose(Prompt("touch_wait", text, finger, (AGAIN, SKIP)))


def _agree(finger: str, findings: Findings) -> Steps[bool]:
    """Name the problems, and return whether the person makes the doubtful touches again."""
    yield from (Say(f"  {finger}: {problem}") for problem in findings.problems)
    names = ", ".join(NAMES[step] for step in findings.doubtful)
    text = f"The touches of finger {finger} do not fit together. Only {names} will be asked for again."
    return (yield from choose(Prompt("touch_again", text, finger, (AGAIN, GO_ON, SKIP)))) == AGAIN


def _image_change(rest: FingerReadings, held: FingerReadings) -> str:
    """Return how the image changed while a touch was held; "" if it did not. On a busy machine it may lag behind."""
    if not rest.images:
        return ""
    if len(held.images) < LEAST_IMAGES:
        return f"had gaps ({len(held.images)} images in {HOLD_S:g} s; is the machine busy?)"
    half = len(held.images) // 2
    first, second = (np.mean(part, axis=0) for part in (held.images[:half], held.images[half:]))
    size = max(float(np.abs(part - rest.image).sum()) for part in (first, second))
    noise = NOISE_STD * float(np.std(rest.images, axis=0).sum()) / math.sqrt(half)
    return "changed" if float(np.abs(second - first).sum()) > STEADY * size + noise else ""
