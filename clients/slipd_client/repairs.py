"""What is wrong with a running slipd, from its status, and what mends it: a list for people and for programs.

Each repair has an id that stays, and a section of ``docs/health.md`` under that id.
"""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from typing import Any, Literal
from urllib.parse import urlsplit

from slipd_client.messages.names import DAEMON_LATE, GRIP_UNKNOWN, REASONS, Health

Severity = Literal["error", "warning"]

DOCUMENT = "docs/health.md"

FINGER_REPAIRS: dict[str, tuple[str, Severity, str]] = {
    "not_tared": ("finger-not-tared", "error", "slipctl tare {finger} all"),
    "no_mu": ("friction-unknown", "warning", "slipctl friction measure {finger}"),
    "weight_unknown": ("gravity-unknown", "error", "slipctl gravity {finger} --help"),
    "pulled": ("finger-pulled", "error", "slipctl tare {finger} all"),
    "disagreement": ("finger-disagreement", "error", "slipctl view"),
    "rotation_unobserved": ("pad-unusable", "warning", "slipctl tare {finger} all"),
}
"""Reason of a finger → id, severity and command of its repair. Streams and motions cause the other reasons."""

NOTICE_REPAIRS: dict[str, tuple[str, Severity, str]] = {
    "config": ("config-kept", "error", "slipd check FILE"),
    "realtime": ("realtime-refused", "warning", "systemctl show slipd -p LimitRTPRIO"),
    "state": ("state-not-kept", "warning", "slipctl status --json"),
}
"""The same of each notice about the host."""

DEGRADED = {
    "no fresh gravity": "slipctl gravity {finger} --help",
    "its zero drifted": "slipctl tare {finger} all",
    "taxels are masked": "slipctl view",
    "the pad image shows one": "slipctl view",
}
"""Words of the message of a degraded stream → command that mends it, or shows more of it than `slipctl watch`."""

READ_ONLY = "Read-only file system"
"""Text of the error EROFS: the disk is mounted read-only, on purpose or by the kernel after a fault."""

DISK_ERROR = "Input/output error"
"""Text of the error EIO: the disk fails. Often the kernel mounts it read-only soon after."""

READ_S = 1.0
"""A stream with a newer reading is connected: what is wrong is not its port or host."""

LATE_S = 0.1
"""Shorter stalls need no repair: the readings are only judged a little later, and the status shows them anyway."""


@dataclass(frozen=True, slots=True)
class Repair:
    """One thing to mend.

    Attributes:
        id: Stable id, e.g. "stream-silent".
        severity: "error": slipd cannot do its work on this; "warning": it can, but less well.
        about: Stream, finger or part, e.g. "left.wrench".
        problem: What is wrong, for people.
        command: Command that mends it, or shows what to mend.
    """

    id: str
    severity: Severity
    about: str
    problem: str
    command: str

    def as_map(self) -> dict[str, str]:
        """Return all fields, and the section of the documents about this repair, for JSON."""
        return {**asdict(self), "link": f"{DOCUMENT}#{self.id}"}


def repairs(status: Mapping[str, Any]) -> list[Repair]:
    """Return what needs a repair: a grip of unknown force first, then errors.

    Args:
        status: Body of the topic ``status``, or the reply to the request of that name. Fields that an older daemon does
            not send are skipped.
    """
    found = [
        *_unknown_grip(status),
        *_host(status),
        *_streams(status),
        *_fingers(status),
        *_gripper(status),
        *_recordings(status),
    ]
    return sorted(found, key=lambda repair: repair.severity != "error")


def summary(status: Mapping[str, Any]) -> str:
    """Return one line: how many streams are read, and the first repairs."""
    streams = _maps(status, "streams")
    read = sum(stream.get("health", Health.STALE) < Health.ERROR for stream in streams.values())
    text = f"{read} of {len(streams)} streams are read"
    found = repairs(status)
    problems = "; ".join(f"{repair.about}: {repair.problem}" for repair in found[:2])
    more = f" (and {len(found) - 2} more)" if len(found) > 2 else ""
    return f"{text}; {problems}{more}" if found else text


def _unknown_grip(status: Mapping[str, Any]) -> Iterator[Repair]:
    if GRIP_UNKNOWN in (_maps(_maps(status, "streams"), "gripper").get("message") or ""):
        problem = f"{GRIP_UNKNOWN}, so no raise is possible: move gently, put it down, then open"
        yield Repair("gripper-force-unknown", "error", "gripper", problem, "slipctl grip open --drop")


def _host(status: Mapping[str, Any]) -> Iterator[Repair]:
    notices = _maps(status, "notices")
    for about, (number, severity, command) in NOTICE_REPAIRS.items():
        if text := notices.get(about):
            yield Repair(number, severity, about, text, command)
    for topic, text in notices.items():
        if topic.startswith("latency "):
            command = f"echo 1 | sudo tee {text.rpartition(' ')[2]}"
            yield Repair("adapter-latency", "warning", topic.removeprefix("latency "), text, command)
    late_s = status.get("late_s") or 0.0
    if late_s > LATE_S:
        yield Repair("daemon-late", "warning", "daemon", f"{DAEMON_LATE} {late_s:.2f} s", "top")


def _streams(status: Mapping[str, Any]) -> Iterator[Repair]:
    for name, stream in _unwell(status).items():
        health, problem = stream.get("health", Health.OK), stream.get("message") or "no reason is given"
        where = _look_at(stream.get("address") or "")
        if health == Health.WARN:
            command = next((DEGRADED[words] for words in DEGRADED if words in problem), "slipctl watch")
            yield Repair("stream-degraded", "warning", name, problem, command.format(finger=name.partition(".")[0]))
        elif health == Health.STALE:
            yield Repair("stream-silent", "error", name, problem, where)
        else:
            age_s = stream.get("age_s")
            number = "stream-missing" if age_s is None else "stream-fault"
            read = age_s is not None and age_s < READ_S
            yield Repair(number, "error", name, problem, "slipctl watch" if read else where)


def _unwell(status: Mapping[str, Any]) -> dict[str, Mapping[str, Any]]:
    """Return the streams that are not well, but for what has a repair of its own: a late daemon, a grip, a fault."""
    latched = f"{_maps(status, 'gripper').get('latched_fault') or GRIP_UNKNOWN} is latched"
    return {
        name: stream
        for name, stream in _maps(status, "streams").items()
        if stream.get("health", Health.OK) != Health.OK
        and not (stream.get("message") or "").startswith((DAEMON_LATE, GRIP_UNKNOWN, latched))
    }


def _fingers(status: Mapping[str, Any]) -> Iterator[Repair]:
    unwell = {name.partition(".")[0] for name in _unwell(status)}
    untared = {
        name.partition(".")[0]
        for name, stream in _maps(status, "streams").items()
        if "tare_origin" in stream and stream["tare_origin"] is None and stream.get("age_s") is not None
    }
    for finger, state in _maps(status, "fingers").items():
        reasons = list(state.get("reasons") or ())
        if finger in untared and "not_tared" not in reasons:
            reasons.append("not_tared")
        known = [reason for reason in reasons if reason in FINGER_REPAIRS]
        for reason in known:
            number, severity, command = FINGER_REPAIRS[reason]
            yield Repair(number, severity, finger, REASONS[reason], command.format(finger=finger))
        if state.get("level") == "unknown" and not known and finger not in unwell:
            why = "; ".join(REASONS.get(reason, reason) for reason in reasons) or "no reason is given"
            yield Repair("finger-unknown", "error", finger, why, "slipctl watch")


def _gripper(status: Mapping[str, Any]) -> Iterator[Repair]:
    gripper = status.get("gripper")
    if not gripper:
        return
    if fault := gripper.get("latched_fault"):
        yield Repair("gripper-fault", "error", "gripper", f"{fault} is latched", "slipctl grip ack")
    if gripper.get("active") is False:
        yield Repair("gripper-inactive", "warning", "gripper", "it is not active", "slipctl grip activate")
    if gripper.get("force_limit_n") is None:
        problem = "the config gives no max_force_n, so that nothing may move"
        yield Repair("gripper-no-limit", "warning", "gripper", problem, "slipd check FILE")


def _recordings(status: Mapping[str, Any]) -> Iterator[Repair]:
    for key in ("recording", "run_recording"):
        recording = status.get(key) or {}
        state, about = recording.get("state"), key.replace("_", " ")
        why = recording.get("failure") or state
        if state == "failed":
            command = _look_at_disk(str(why), recording.get("path"))
            yield Repair("recording-failed", "error", about, str(why), command)
        elif state == "limited":
            yield Repair("recording-limited", "warning", about, str(why), "df -h")
    if failure := _maps(status, "incidents").get("failure"):
        path = str(failure).partition(": not saved: ")[0]
        yield Repair("incident-failed", "error", "incidents", str(failure), _look_at_disk(str(failure), path))


def _look_at_disk(failure: str, path: str | None) -> str:
    """Return the command that shows what is wrong with the disk of a file."""
    if path and READ_ONLY in failure:
        return f"findmnt --target {shlex.quote(path)}"
    return "dmesg --level err" if DISK_ERROR in failure else "df -h"


def _look_at(address: str) -> str:
    """Return the command that shows whether the port or host of a stream is there."""
    if address.startswith("/"):
        return f"ls -l {address} /dev/serial/by-id"
    if address.startswith(("tcp:", "udp:", "ws:")):
        return f"ping -c 3 {urlsplit(address).hostname}"
    return "slipctl status --json"


def _maps(status: Mapping[str, Any], key: str) -> Mapping[str, Any]:
    return status.get(key) or {}
