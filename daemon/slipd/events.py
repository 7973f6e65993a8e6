"""Events that enter the engine, outputs that leave it, and the clocks in which their times are.

Everything that can change a decision is one of these events. A recording is their sequence, and a replay feeds the same
sequence to the same engine.
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any, NamedTuple

from slipd.devices import Inquiry


@dataclass(slots=True, frozen=True)
class LinkSpec:
    """A port, socket or server that the engine wants opened.

    Attributes:
        name: Name of the link, e.g. ``left.wrench``.
        transport: "serial", "tcp", "udp", "websocket", "external" or "local".
        address: Path of a serial port; ``tcp://HOST:PORT``, ``udp://HOST:PORT`` or URL of a server; endpoint of the
            socket to which other processes push, or path of the socket to which a driver connects.
        baud: Line speed of a serial port, bit/s; 0 for other transports.
        inquiry: Request that is sent over TCP before the link is up; its answer is the first `Bytes` of the link.
    """

    name: str
    transport: str
    address: str
    baud: int = 0
    inquiry: Inquiry | None = None


class Bytes(NamedTuple):
    """Bytes that one read of a link returned."""

    link: str
    data: bytes


@dataclass(slots=True, frozen=True)
class LinkUp:
    """A link was opened; ``identity`` is what was opened, e.g. a path or an address."""

    link: str
    identity: str


@dataclass(slots=True, frozen=True)
class LinkDown:
    """A link closed or could not be opened; ``reason`` is a text for people."""

    link: str
    reason: str


@dataclass(slots=True, frozen=True)
class Request:
    """A request of a client: a well-formed map whose fields are not checked yet."""

    client: bytes
    body: dict[str, Any]


class Tick(NamedTuple):
    """Time passed.

    Attributes:
        suspended_ns: How long the host has slept since boot (CLOCK_BOOTTIME − CLOCK_MONOTONIC).
        unread: The daemon stalled, and its lines were not read empty since: bytes may still wait there.
        raw_ns: CLOCK_MONOTONIC_RAW, which NTP does not slew; 0 if it could not be read at the time of the tick.
        wall_minus_monotonic_ns: Wall clock less CLOCK_MONOTONIC; 0 while it is that of the start of the run.
    """

    suspended_ns: int = 0
    unread: bool = False
    raw_ns: int = 0
    wall_minus_monotonic_ns: int = 0


@dataclass(slots=True, frozen=True)
class RecordingChanged:
    """A recording began, lost entries, or ended by itself.

    Attributes:
        name: Name of its file, as in `Record`; "" for the recording of the whole run.
        path: Path of its file.
        state: "running"; "limited": a limit of the config ended it in good order or prevented it; or "failed": its file
            could not be created or written.
        reason: Why it does not run, for people; "" while it runs.
        lost: Number of entries known to be missing from the file.
    """

    name: str
    path: str
    state: str
    reason: str = ""
    lost: int = 0


@dataclass(slots=True, frozen=True)
class IncidentsChanged:
    """An incident was saved or not, or entries are missing from the memory of the last seconds.

    Attributes:
        saved: Number of files saved in this run.
        failed: Number of files that could not be saved.
        lost: Number of entries that never reached the memory, because its thread was too slow.
        dropped: Number of entries that left the memory before their time, because it was full.
        path: Path of the last file that was saved; "" before the first.
        reason: Why the last file was not saved, for people; "" if it was.
    """

    saved: int
    failed: int
    lost: int
    dropped: int
    path: str
    reason: str


@dataclass(slots=True, frozen=True)
class HostNotice:
    """A problem of the host that people should know; ``status`` shows it until the next notice of its topic.

    Attributes:
        topic: "config": a faulty file was not reloaded; "realtime": the priority is not permitted; "state": what the
            next run may need cannot be written; "latency" and a link: an adapter holds its bytes back.
        text: The notice, for people; "" ends it.
    """

    topic: str
    text: str


@dataclass(slots=True, frozen=True)
class StateRestored:
    """What the run before this one kept, as the first event of a run; see `slipd.gripper.stored_state`.

    A tare is used again once its device answers, if device, config and age allow it and the readings agree. The rest
    describes the grip of that time: it counts only where the gripper confirms that it still holds what it held.

    Attributes:
        text: Text of the state; "" where there is none that can be read.
        problem: Why what was kept cannot be read, for people; "" where it can.
    """

    text: str
    problem: str = ""


FirstEvents = tuple[StateRestored | LinkUp, ...]
"""What precedes the events of a recording that begins during a run."""

Event = Bytes | LinkUp | LinkDown | Request | Tick | RecordingChanged | IncidentsChanged | HostNotice | StateRestored


Body = dict[str, Any]
"""A map on the wire: a message, the result of a reply, or a part of either. What is not known is None, never NaN."""


class Publish(NamedTuple):
    """A message for every subscriber of ``topic``; ``frame`` is that of its vectors, one for each finger."""

    topic: str
    body: Body
    frame: str = ""


@dataclass(slots=True, frozen=True)
class Write:
    """Bytes for the device behind ``link``."""

    link: str
    data: bytes


@dataclass(slots=True, frozen=True)
class Reply:
    """The answer to a request of ``client``."""

    client: bytes
    body: Body


@dataclass(slots=True, frozen=True)
class Record:
    """Begin a recording, or end the one that runs.

    Attributes:
        name: Name of its file; "" ends the recording that runs.
        first: Its first events: the state in force when it begins, without which a replay would know no zero, and the
            links that are open, without which it would take no bytes from them.
    """

    name: str
    first: FirstEvents = ()


Output = Publish | Write | Reply | Record

NEVER_NS = 2**63 - 1
"""Deadline of what waits for no time."""
_SPAN_S = 10**11
"""Largest wall time in a name, in the year 5138; a replayed file may contain any time."""


class WallClock:
    """Relate CLOCK_MONOTONIC to the wall clock.

    The wall clock moves against CLOCK_MONOTONIC while the host sleeps, and when somebody sets it.

    Args:
        minus_monotonic_ns: Wall clock less CLOCK_MONOTONIC at the start of the run.

    Attributes:
        minus_monotonic_ns: Likewise now.
    """

    def __init__(self, minus_monotonic_ns: int) -> None:
        self.minus_monotonic_ns = minus_monotonic_ns

    def at_ns(self, t_ns: int) -> int:
        """Return the wall time at ``t_ns``, ns since 1970."""
        return t_ns + self.minus_monotonic_ns

    def stamp(self, t_ns: int) -> str:
        """Return the wall time at ``t_ns`` for the name of a file, such as "20261122T221300Z"."""
        return datetime.fromtimestamp(self.at_ns(t_ns) // 10**9 % _SPAN_S, UTC).strftime("%Y%m%dT%H%M%SZ")
