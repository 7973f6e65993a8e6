"""What is wrong with each stream, for people: its link, its rate and times, its readings, and why it is silent."""

from __future__ import annotations

import math

from slipd.devices import Device
from slipd.events import LinkSpec
from slipd.finger.finger import Finger
from slipd.finger.force_channel import ForceChannel
from slipd.finger.image_channel import ImageChannel
from slipd.finger.verdict import PAD_PULLED
from slipd.links.device_link import FLOOD_FACTOR, DeviceLink
from slipd.links.stream_meter import RATE_TOLERANCE, StreamMeter
from slipd.signals.tare import Tare
from slipd.types.samples import UNTRUSTED_WORDS
from slipd_client.messages import Health
from slipd_client.messages.names import DAEMON_LATE

Condition = tuple[Health, str]
"""Severity and text."""

SHOWN_NS = 1_000_000_000
"""A flood, an error in decoding, or a time of another clock is reported for this long after it came last."""
SILENT_NS = 1_000_000_000
"""A longer silence of a stream is explained; bytes count as arriving for this long."""

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


def link_condition(
    link: DeviceLink, stream: StreamMeter, t_ns: int, unread_ns: int | None = None, late_ns: int = 0
) -> Condition:
    """Return the health of a stream of a link, and a message for people.

    Args:
        link: The link.
        stream: One of its streams.
        t_ns: Now.
        unread_ns: For how long a line that brought nothing counts as unread; None: it is empty.
        late_ns: The longest recent stall of the daemon.
    """
    counters, flooded_ns = link.counters, link.flood.dropped_ns
    stream.measure(t_ns, counters.bad_bytes, late_ns)
    if not link.up or link.guard.mismatch:
        return Health.ERROR, link.guard.mismatch if link.up else link.message
    if link.fault and t_ns - link.fault_ns < SHOWN_NS:
        return Health.ERROR, link.fault
    if flooded_ns is not None and t_ns - flooded_ns < SHOWN_NS:
        return Health.WARN, f"sends more than {FLOOD_FACTOR:g} times its rate: the oldest readings are dropped"
    health, message = _stream_condition(stream, t_ns, unread_ns, late_ns)
    if health is Health.OK and counters.warning:
        return Health.WARN, counters.warning
    if health is not Health.STALE:
        return health, ": ".join(filter(None, (message, counters.warning, counters.note)))
    if t_ns - max(link.opened_ns, stream.last_ns or 0) <= SILENT_NS:
        return health, message
    why = counters.note or _why_silent(link, stream, t_ns)
    return health, why if stream.last_ns is None else f"{message}: {why}"


def _stream_condition(stream: StreamMeter, t_ns: int, unread_ns: int | None, late_ns: int) -> Condition:
    freshness, clock, rate_hz = stream.freshness, stream.clock, stream.rate_hz
    if stream.misfit:
        return Health.ERROR, stream.misfit
    if stream.last_ns is None:
        return Health.STALE, "open, but no reading yet"
    if freshness.is_stale(t_ns, unread_ns):
        return Health.STALE, f"no reading for {freshness.silent_ns(t_ns, unread_ns) * 1e-9:.2f} s"
    if clock.late_ns > freshness.stale_ns:
        return (
            Health.STALE,
            f"its readings are {clock.late_ns * 1e-9:.2f} s older than before when they come:"
            " does a driver, gateway or adapter buffer them? restart it",
        )
    if stream.host_clock and freshness.late:
        old_s = (freshness.received_ns - freshness.acquired_ns) * 1e-9
        why = "does the program that pushes them hold them back, or repeat a time?"
        return Health.STALE, f"its readings are {old_s:.2f} s old when they come: {why}"
    if late_ns > freshness.stale_ns:
        return Health.WARN, f"{DAEMON_LATE} {late_ns * 1e-9:.2f} s: readings waited, the sensor went on"
    if stream.damage > 0:
        return Health.WARN, f"{stream.damage} recent bytes belong to no frame"
    if stream.bad_time_ns is not None and t_ns - stream.bad_time_ns < SHOWN_NS:
        return Health.WARN, "its times are not of this host's CLOCK_MONOTONIC: receipt times are used"
    if clock.state == "not_a_clock":
        return (
            Health.WARN,
            "its clock is unusable (stuck, jumping, or off by more than 1000 ppm): receipt times are used",
        )
    if rate_hz is not None and abs(rate_hz - stream.expected_hz) > RATE_TOLERANCE * stream.expected_hz:
        hint = stream.rate_hint and f": {stream.rate_hint}"
        return Health.WARN, f"{rate_hz:.0f} Hz instead of {stream.expected_hz:.0f} Hz{hint}"
    return Health.OK, ""


def _why_silent(link: DeviceLink, stream: StreamMeter, t_ns: int) -> str:
    bad_bytes = link.counters.bad_bytes
    newest_ns = max((each.last_ns for each in link.streams.values() if each.last_ns is not None), default=None)
    return why_silent(
        link.device,
        link.spec,
        next(name for name, each in link.streams.items() if each is stream),
        bytes_come=link.received_ns is not None and t_ns - link.received_ns <= SILENT_NS,
        garbled=bad_bytes > link.bad_bytes_before if stream.last_ns is None else stream.damage > 0,
        others=newest_ns is not None and t_ns - newest_ns <= SILENT_NS,
        state=link.session.state if link.session is not None else "",
    )


def why_silent(
    device: Device, spec: LinkSpec, sensor: str, *, bytes_come: bool, garbled: bool, others: bool = False, state: str
) -> str:
    """Return why an open link may give no reading, and what to check at the device.

    Args:
        device: What is expected on the link.
        spec: The link.
        sensor: Which sensor of the port is silent; "" where it carries one.
        bytes_come: Bytes arrive.
        garbled: Some of them belong to no frame.
        others: Readings of other sensors on the same port arrive.
        state: State of the conversation with the device; "" where there is none.
    """
    numbering = " does its `seq` count up?" if spec.transport == "external" else ""
    if others:
        return f"readings arrive, none of sensor {sensor!r}: is it plugged in? is `sensor` right?{numbering}"
    if not bytes_come:
        return _no_bytes(spec)
    if garbled and spec.transport in ("external", "local"):
        return f"bytes arrive, none is {device.frame}: does the driver pack them as docs/devices.md says?"
    if garbled:
        return f"bytes arrive, none is {device.frame}: {_line(device, spec)} is it another device?"
    doing = f" ({state})" if state else ""
    return f"bytes arrive, but no reading{doing}{numbering and ':' + numbering}"


def _no_bytes(spec: LinkSpec) -> str:
    if spec.transport == "external":
        return f"open, but nobody pushes readings: does the driver run, and does it push to {spec.address}?"
    if spec.transport == "local":
        return "a driver is connected, but sends nothing: does it register the gripper?"
    where = "this port" if spec.transport == "serial" else spec.address
    return f"open, but no bytes arrive: is it powered? is it connected to {where}?"


def _line(device: Device, spec: LinkSpec) -> str:
    """Ask about the setting that makes a device unreadable, or selects another one."""
    if spec.transport != "serial":
        return f"is {spec.address} its address?"
    default = f" (the default is {device.baud})" if spec.baud != device.baud else ""
    return f"is the baud rate {spec.baud}{default}?"


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
