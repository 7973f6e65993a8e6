"""Messages about one finger: ``slip``, ``warning``, ``wrench`` and ``tactile``, and when they are published."""

from __future__ import annotations

from math import isfinite, nan
from typing import cast

from slipd.config import Rates
from slipd.events import Body, Output
from slipd.finger.finger import Finger
from slipd.finger.finger_state import FingerState, VerdictBatch
from slipd.finger.force_channel import ForceChannel
from slipd.finger.image_channel import ImageChannel
from slipd.friction.friction_state import FrictionState
from slipd.fusion.verdict_numbers import MODELS
from slipd.publish.message_sequencer import MessageSequencer, Pace
from slipd.types.arrays import finite_list, finite_or_none
from slipd_client.messages import (
    LEVELS,
    SEVERITY,
    WARNING_TOPIC,
    Level,
    slip_topic,
    tactile_topic,
    wrench_topic,
)

NEWTON, UNCALIBRATED = "N", "uncalibrated"
"""``force_unit``: the unit of every force in a message; torques are in this unit times metres."""
_NO_WRENCH = (nan,) * 6


def slip_body(finger: Finger, state: FingerState) -> Body:
    """Return ``slip.<finger>``: the verdict on one contact, and the quantities behind it."""
    force, image, distribution = finger.force, finger.image, state.load_distribution
    numbers = state.numbers(finger.config)
    required = numbers.required_friction
    carried = None if state.friction is None else state.friction.carried
    return {
        **_verdict(finger, state),
        "force_unit": _force_unit(finger, state),
        "normal_n": numbers.normal_n,
        "tangential_n": _vector(numbers.fx_n, numbers.fy_n),
        "spin_nm": numbers.spin_nm,
        "centroid_m": _vector(numbers.cx_m, numbers.cy_m),
        "centroid_std_m": _vector(numbers.cx_std_m, numbers.cy_std_m),
        "friction_ratio": numbers.friction_ratio,
        "friction_ratio_std": numbers.friction_ratio_std,
        "gravity": None if force is None else force.gravity.state(state.t_ns),
        **friction_body(state.friction or finger.friction.state),
        "required_friction": required,
        "carried_friction": carried,
        "relative_utilisation": None if carried is None or required is None else required / carried,
        "utilisation": numbers.utilisation,
        "utilisation_lower": numbers.utilisation_lower,
        "utilisation_upper": numbers.utilisation_upper,
        "torque_limit_nm": numbers.torque_limit_nm,
        "grip_needed_n": numbers.needed_n,
        "pole_m": _vector(numbers.pole_x_m, numbers.pole_y_m),
        "tipping_margin_m": numbers.tipping_margin_m,
        "tipping_margin_std_m": None if image is None else 0.5 * image.geometry.pitch_m,
        "centroid_residual_m": None if distribution is None else finite_or_none(distribution.centroid_residual_m),
        "model": MODELS[numbers.model],
        "tare_id": finger.tare.current.id,
        **tare_body(finger.main, state.t_ns),
        "age_s": state.age_s,
    }


def _vector(*components: float | None) -> list[float | None] | None:
    """Return a vector; None where a component is not known."""
    return None if None in components else list(components)


def warning_body(finger: Finger, state: FingerState, previous: str) -> Body:
    """Return ``warning``: the level of a finger is no longer ``previous``."""
    return {
        **_verdict(finger, state),
        "previous": previous,
        "rising": SEVERITY[state.verdict.level] > SEVERITY[previous],
        "utilisation": None if state.utilisation is None else finite_or_none(state.utilisation.value),
    }


def wrench_body(finger: Finger, state: FingerState) -> Body:
    """Return ``wrench.<finger>``: the force on the finger in the pad frame, tared and mounted."""
    wrench = state.wrench or _NO_WRENCH
    fx_n, fy_n, fz_n, *torque_nm = [number if isfinite(number) else None for number in wrench]
    return {
        "finger": finger.name,
        "force_unit": _force_unit(finger, state),
        "force_n": _vector(fx_n, fy_n, fz_n),
        "torque_nm": _vector(*torque_nm),
        "normal_n": None if fz_n is None else -fz_n,
        "tangential_n": _vector(fx_n, fy_n),
        "status": list(state.status),
        "tare_id": finger.tare.current.id,
        "age_s": state.age_s,
    }


def tactile_body(finger: Finger, image: ImageChannel) -> Body:
    """Return ``tactile.<finger>``: loads on the taxels in scan order, and the shape of the contact."""
    known = not image.reasons
    shape = image.shape() if known else None
    geometry = image.geometry
    return {
        "finger": finger.name,
        "rows": geometry.rows,
        "cols": geometry.cols,
        "pitch_m": geometry.pitch_m,
        "rows_along": geometry.rows_along,
        "cols_along": geometry.cols_along,
        "tare_id": image.tare.current.id,
        **tare_body(image, image.t_ns),
        "image_ok": known,
        "image_reasons": list(image.reasons),
        "force_unit": NEWTON if finger.image_in_newtons else UNCALIBRATED,
        "loads_n": image.pressure.tolist() if known else None,
        "active": None if shape is None else shape.active,
        "area_m2": None if shape is None else shape.area_m2,
        "centroid_m": None if shape is None else finite_list(shape.centroid_m),
        "axis_rad": None if shape is None else finite_or_none(shape.axis_rad),
        "elongation": None if shape is None else finite_or_none(shape.elongation),
        "holes": None if shape is None else shape.holes,
        "corners_m": None if shape is None else shape.corners_m.tolist(),
        "status": list(image.status),
    }


def tare_body(channel: ForceChannel | ImageChannel, t_ns: int | None) -> Body:
    """Return where the zero of a channel comes from, and its age at ``t_ns``; nil where it is not known."""
    age_s = None if t_ns is None else channel.tare.current.age_s(t_ns)
    return {"tare_origin": channel.zero.origin, "tare_age_s": age_s}


def friction_body(friction: FrictionState) -> Body:
    """Return the friction of one finger, its source and its interval."""
    return {
        "mu": friction.mu,
        "mu_source": friction.source,
        "mu_low": friction.mu_low,
        "mu_high": friction.mu_high,
        "mu_d": friction.mu_d,
    }


def friction_setter_body(finger: Finger) -> Body:
    """Return the friction in use of one finger, and which client set it."""
    friction = finger.friction
    return {**friction_body(friction.state), "mu_by": friction.set_by, "mu_t_ns": friction.set_t_ns}


def _verdict(finger: Finger, state: FingerState) -> Body:
    """Return the fields that ``slip`` and ``warning`` share."""
    return {
        "finger": finger.name,
        "level": state.verdict.level,
        "level_code": LEVELS.index(state.verdict.level),
        "reasons": list(state.verdict.reasons),
        "evidence": list(state.evidence),
    }


def _force_unit(finger: Finger, state: FingerState) -> str:
    return NEWTON if finger.in_newtons and "raw" not in state.status else UNCALIBRATED


class FingerPublisher:
    """Publish a change of level at once, and all else at the configured rates.

    Args:
        finger: The finger.
        sequencer: Numbers and dates the messages.
        rates: ``[rates]``.

    Attributes:
        finger: The finger.
        level: Level that was published last.
    """

    def __init__(self, finger: Finger, sequencer: MessageSequencer, rates: Rates) -> None:
        self.finger = finger
        self._sequencer = sequencer
        self._frame = f"{finger.name}_pad"
        self._slip_topic, self._wrench_topic = slip_topic(finger.name), wrench_topic(finger.name)
        self._tactile_topic = tactile_topic(finger.name)
        self.level: Level = "unknown"
        self._slip, self._wrench = Pace(rates.slip_hz), Pace(rates.wrench_hz)
        self._tactile = Pace(rates.tactile_hz)

    def publish_state(self, state: FingerState, out: list[Output]) -> None:
        """Append the messages about a new state of the finger."""
        finger, t_ns, level = self.finger, state.t_ns, cast("Level", state.verdict.level)
        if level != self.level:
            previous, self.level = self.level, level
            self._append(WARNING_TOPIC, t_ns, warning_body(finger, state, previous), out)
        if self._slip.passes(t_ns, level):
            self._append(self._slip_topic, t_ns, slip_body(finger, state), out)
        if self._wrench.passes(t_ns, level):
            self._append(self._wrench_topic, t_ns, wrench_body(finger, state), out)

    def publish_batch(self, batch: VerdictBatch, out: list[Output]) -> None:
        """Append the messages about the readings of one read: the same as about each of their states."""
        slip, wrench, times_ns = self._slip, self._wrench, batch.readings.times_ns
        for at, level in enumerate(batch.levels):
            t_ns = times_ns[at]
            if t_ns >= slip.due_ns or LEVELS[level] != self.level:
                self.publish_state(batch[at], out)
            elif t_ns >= wrench.due_ns:
                wrench.passes(t_ns, self.level)
                self._append(self._wrench_topic, t_ns, wrench_body(self.finger, batch[at]), out)

    def publish_image(self, t_ns: int, out: list[Output]) -> None:
        """Append the message about the newest image; at once where the image became usable or unusable."""
        finger, image = self.finger, self.finger.image
        if image is not None and self._tactile.passes(t_ns, image.reasons):
            self._append(self._tactile_topic, t_ns, tactile_body(finger, image), out)

    def _append(self, topic: str, t_ns: int, body: Body, out: list[Output]) -> None:
        out.append(self._sequencer.message(topic, t_ns, self._frame, body))
