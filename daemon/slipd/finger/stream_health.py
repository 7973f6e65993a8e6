"""Health of a finger's streams, with texts for people: what is wrong, and what to check."""

from __future__ import annotations

import math

from slipd.finger.finger import Finger
from slipd.finger.force_channel import ForceChannel
from slipd.finger.image_channel import ImageChannel
from slipd.finger.verdict import PAD_PULLED
from slipd.signals.tare import Tare
from slipd.types.samples import UNTRUSTED_WORDS
from slipd_client.messages import Health

Condition = tuple[Health, str]
"""Severity and text."""

_FORCE_FAULTS: dict[str, Condition] = {
    "stuck": (Health.ERROR, "its readings repeat: it hangs, or stuck_after is too small for this sensor"),
    "garbage": (
        Health.ERROR,
        "its readings are out of range_n or range_nm, or jump to and fro: check the range and units of the sensor",
    ),
    "not_finite": (Health.ERROR, "its readings are not finite numbers"),
    "intermittent": (Health.WARN, "it failed several times within 10 s"),
}
_UNTARED = "its zero is not known: tare it while nothing touches the finger"
"""Not a fault of the stream: that it has to be tared is the normal state after a first start."""
_UNUSABLE_IMAGES = {
    "not_finite": "its images hold readings that are not finite numbers",
    "garbage": "its readings are larger than those of any pad: check axis_scale and the configuration of the pad",
}


def finger_conditions(finger: Finger, stream: str, t_ns: int) -> list[Condition]:
    """Return what people should know of the readings of the stream "wrench" or "pad" of a finger at ``t_ns``."""
    channel = finger.channels[stream]
    found = force_conditions(channel, t_ns) if isinstance(channel, ForceChannel) else image_conditions(channel)
    if finger.state.verdict is PAD_PULLED and stream == finger.main_stream:
        found.append(_pulled(finger))
    if stream == "wrench" and finger.presence.is_missed_by_force():
        found.append((Health.WARN, "it measures no contact, and the pad image shows one: no grip is raised"))
    return found


def _pulled(finger: Finger) -> Condition:
    """Return what people should check where the normal force is clearly negative: nothing pulls on a pad."""
    wrench = finger.state.wrench
    normal_n = math.nan if wrench is None else -wrench[2]
    what = f"is {normal_n:.3g} N" if normal_n < 0.0 else "was negative a moment ago"
    text = f"its normal force {what}, and nothing pulls on a pad: check "
    if finger.force is None:
        return Health.ERROR, text + "the signs of axis_scale, and tare it"
    text += "sign, pad_from_sensor (quat_xyzw is in the order x, y, z, w) and the sensor's own configuration"
    if finger.presence.is_pressed_by_image():
        text += "; the pad image shows a contact, so the force sensor is wrong"
    elif not finger.zero_known:
        text += "; if it is the bias of an unloaded sensor, tare it with unloaded = true"
    return Health.ERROR, text


def force_conditions(force: ForceChannel, t_ns: int) -> list[Condition]:
    """Return what people should know of the readings of a force sensor at ``t_ns``."""
    found = [_FORCE_FAULTS[force.fault]] if force.fault else []
    if not force.zero.known:
        found.append((Health.OK, _UNTARED))
    found += _device_status(force.status)
    if force.gravity.state(t_ns) == "unknown_orientation":
        unknown_n, _ = force.gravity.uncertainty(t_ns)
        missing = "an arm stream ([grasp.arm]) removes it, or gravity.set, slipctl gravity or slipctl serve ros2"
        found.append((Health.WARN, f"no fresh gravity: the finger's weight may add {unknown_n:.2f} N; {missing}"))
        if force.tare.current.gravity_mps2 is None:
            found.append((Health.OK, "tare it once more while gravity is known: the last tare holds an unknown weight"))
    if force.drift is not None and force.drift.total >= 1.0:
        found.append((Health.WARN, "its zero drifted to the limit of what is followed: tare it"))
    return found + _aborted_tare(force.tare)


def image_conditions(image: ImageChannel) -> list[Condition]:
    """Return what people should know of the images of a pad."""
    found = _device_status(image.status)
    if not image.zero.known:
        found.append((Health.OK, _UNTARED))
    if image.is_frozen:
        found.append((Health.ERROR, "its images repeat while the force moves: it hangs"))
    if image.repeats:
        found.append((Health.ERROR, "its images repeat: it hangs, or stuck_after is too small for a pad this still"))
    found += [(Health.ERROR, _UNUSABLE_IMAGES[reason]) for reason in image.reasons if reason in _UNUSABLE_IMAGES]
    faults = image.taxel_health.report().items()
    masked = "; ".join(f"{kind} {', '.join(map(str, taxels))}" for kind, taxels in faults if taxels)
    if masked and not image.taxel_health.usable:
        found.append((Health.ERROR, f"too many taxels are masked: {masked}"))
    elif masked:
        found.append((Health.WARN, f"taxels are masked: {masked}"))
    return found + _aborted_tare(image.tare)


def _device_status(status: tuple[str, ...]) -> list[Condition]:
    if not status:
        return []
    level = Health.WARN if UNTRUSTED_WORDS.isdisjoint(status) else Health.ERROR
    return [(level, f"the device reports: {', '.join(status)}")]


def _aborted_tare(tare: Tare) -> list[Condition]:
    return [(Health.OK, f"the last tare was given up: {tare.aborted_text}")] if tare.aborted_text else []
