"""Messages about one finger: ``slip``, ``warning``, ``wrench`` and ``tactile``, and when they are published."""

from __future__ import annotations

from typing import cast

from slipd.config import Rates
from slipd.events import Output
from slipd.finger.finger import Finger
from slipd.finger.finger_state import FingerState, VerdictBatch
from slipd.finger.force_channel import ForceChannel
from slipd.finger.image_channel import ImageChannel
from slipd.finger.verdict import PAD_PULLED
from slipd.friction.friction_state import FrictionState
from slipd.fusion import Contact
from slipd.publish.message_sequencer import Body, MessageSequencer, Pace, array, finite, numbers
from slipd.types.arrays import finite_or_none
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


def slip_body(finger: Finger, state: FingerState) -> Body:
    """Return ``slip.<finger>``: the verdict on one contact, and the quantities behind it."""
    force, image, used, distribution = finger.force, finger.image, state.utilisation, state.load_distribution
    return {
        **_verdict(finger, state),
        "force_unit": _force_unit(finger, state),
        "normal_n": finite_or_none(_normal_n(state)),
        **_contact_body(state.contact),
        "gravity": None if force is None else force.gravity.state(state.t_ns),
        **friction_body(state.friction or finger.friction.state),
        **_required_friction(state),
        "utilisation": None if used is None else finite_or_none(used.value),
        "utilisation_lower": None if used is None else finite_or_none(used.lower),
        "utilisation_upper": None if used is None else finite_or_none(used.upper),
        "torque_limit_nm": state.torque_limit_nm(finger.config),
        "grip_needed_n": state.needed_normal_n(finger.config),
        "pole_m": None if used is None else array(used.pole_m),
        "tipping_margin_m": finite_or_none(state.tipping_margin_m),
        "tipping_margin_std_m": None if image is None else 0.5 * image.geometry.pitch_m,
        "centroid_residual_m": None if distribution is None else finite_or_none(distribution.loads.centroid_residual_m),
        "model": state.model,
        "tare_id": finger.tare.current.id,
        **tare_body(finger.main, state.t_ns),
        "age_s": state.age_s,
    }


def _contact_body(contact: Contact | None) -> Body:
    """Return the forces of a contact and where they act, which takes a torque."""
    if contact is None or not contact.valid:
        return _NO_CONTACT
    return {
        "tangential_n": numbers((contact.fx_n, contact.fy_n)),
        "spin_nm": finite_or_none(contact.spin_nm),
        "centroid_m": numbers((contact.cx_m, contact.cy_m)),
        "centroid_std_m": numbers((contact.cx_std_m, contact.cy_std_m)),
        "friction_ratio": finite_or_none(contact.friction_ratio),
        "friction_ratio_std": finite_or_none(contact.friction_ratio_std),
    }


_NO_CONTACT: Body = dict.fromkeys(
    ("tangential_n", "spin_nm", "centroid_m", "centroid_std_m", "friction_ratio", "friction_ratio_std")
)


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
    wrench = state.wrench
    return {
        "finger": finger.name,
        "force_unit": _force_unit(finger, state),
        "force_n": None if wrench is None else numbers(wrench[:3]),
        "torque_nm": None if wrench is None else numbers(wrench[3:]),
        "normal_n": None if wrench is None else finite_or_none(-wrench[2]),
        "tangential_n": None if wrench is None else numbers(wrench[:2]),
        "status": list(state.status),
        "tare_id": finger.tare.current.id,
        "age_s": state.age_s,
    }


def tactile_body(finger: Finger, image: ImageChannel) -> Body:
    """Return ``tactile.<finger>``: loads on the taxels in scan order, and the shape of the contact."""
    known = not image.reasons
    shape = image.shape() if known else None
    geometry = image.geometry
    body = {
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
        "centroid_m": None if shape is None else array(shape.centroid_m),
        "axis_rad": None if shape is None else shape.axis_rad,
        "elongation": None if shape is None else shape.elongation,
        "holes": None if shape is None else shape.holes,
        "corners_m": None if shape is None else shape.corners_m.tolist(),
        "status": list(image.status),
    }
    return finite(body)


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


def _required_friction(state: FingerState) -> Body:
    """Return what friction the load requires, beside what this grasp has carried."""
    required = None if state.assessment is None else finite_or_none(state.assessment.required_friction)
    carried = None if state.friction is None else state.friction.carried
    return {
        "required_friction": required,
        "carried_friction": carried,
        "relative_utilisation": None if carried is None or required is None else required / carried,
    }


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


def _normal_n(state: FingerState) -> float | None:
    """Return the normal force, N; also the negative one for which nothing else is known."""
    if state.contact is not None:
        return state.contact.normal_n
    return -state.wrench[2] if state.verdict is PAD_PULLED and state.wrench is not None else None


class FingerPublisher:
    """Publish a change of level at once, and all else at the configured rates.

    Args:
        finger: The finger.
        sequencer: Numbers and dates the messages.
        rates: ``[rates]``.

    Attributes:
        level: Level that was published last.
    """

    def __init__(self, finger: Finger, sequencer: MessageSequencer, rates: Rates) -> None:
        self._finger = finger
        self._sequencer = sequencer
        self._frame = f"{finger.name}_pad"
        self._slip_topic, self._wrench_topic = slip_topic(finger.name), wrench_topic(finger.name)
        self._tactile_topic = tactile_topic(finger.name)
        self.level: Level = "unknown"
        self._slip, self._wrench = Pace(rates.slip_hz), Pace(rates.wrench_hz)
        self._tactile = Pace(rates.tactile_hz)

    def publish_state(self, state: FingerState, out: list[Output]) -> None:
        """Append the messages about a new state of the finger."""
        finger, t_ns, level = self._finger, state.t_ns, cast("Level", state.verdict.level)
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
                self._append(self._wrench_topic, t_ns, wrench_body(self._finger, batch.force_state(at)), out)

    def publish_image(self, t_ns: int, out: list[Output]) -> None:
        """Append the message about the newest image; at once where the image became usable or unusable."""
        finger, image = self._finger, self._finger.image
        if image is not None and self._tactile.passes(t_ns, image.reasons):
            self._append(self._tactile_topic, t_ns, tactile_body(finger, image), out)

    def _append(self, topic: str, t_ns: int, body: Body, out: list[Output]) -> None:
        out.append(self._sequencer.message(topic, t_ns, self._frame, body))
