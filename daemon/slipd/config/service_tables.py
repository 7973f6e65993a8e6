"""Tables of the service: ``[levels]``, ``[rates]``, ``[bus]``, ``[requests]``, ``[recording]`` and its host."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from slipd.config.stream_tables import Hertz
from slipd.config.value_bounds import StrictModel, within

File = Annotated[str, Field(pattern=r"^/[^\x00-\x1f]+$")]
"""An absolute path."""


class Levels(StrictModel):
    """``[levels]``: thresholds on the upper bound of the utilisation.

    Attributes:
        caution: Utilisation at which the level becomes "caution"; below ``warning``. Wrong: too low, and caution is the
            normal state; too high, and it comes late.
        warning: Utilisation at which the level becomes "warning". Wrong: too high, and the warning comes too late to
            act; too low, and it is ignored.
        hysteresis: How far the utilisation must fall below a threshold before the level is left; below ``caution``.
            A load that grows steadily is warned of by as much before its threshold. Wrong: too small, and the level
            flickers; too large, and it stays after the danger.
        false_alarms_per_hour: How often noise alone may be reported as a slip, on each finger, 1/h. Wrong: too high,
            and noise is reported; too low, and slips are reported later.
    """

    caution: float = Field(default=0.70, gt=0.0, lt=1.0)
    warning: float = Field(default=0.85, gt=0.0, le=1.0)
    hysteresis: float = Field(default=0.05, ge=0.0, lt=0.5)
    false_alarms_per_hour: Annotated[float, within(1e-3, 100.0, "/h")] = 1.0  # from once in six weeks to once in 36 s


class Rates(StrictModel):
    """``[rates]``: highest publishing rate of each topic, Hz of data time. A change of level is always published.

    Attributes:
        slip_hz: Of `slip`, each finger. Wrong: too low, and displays lag; too high costs processor time in every
            subscriber.
        wrench_hz: Of `wrench`, each finger. Wrong: likewise.
        tactile_hz: Of `tactile`, each finger. Wrong: likewise.
        grasp_hz: Of `grasp`. Wrong: likewise.
        status_hz: Of `status`. Wrong: likewise.
    """

    slip_hz: Hertz = 250.0
    wrench_hz: Hertz = 250.0
    tactile_hz: Hertz = 50.0
    grasp_hz: Hertz = 50.0
    status_hz: Hertz = 1.0


class Bus(StrictModel):
    """``[bus]``: the endpoints, and who may connect to them.

    Attributes:
        publish: ZeroMQ endpoint of the messages; None: a socket in the private runtime directory. An endpoint over TCP
            needs ``secret_key`` and ``readers``. Wrong: clients find no daemon.
        requests: ZeroMQ endpoint of the requests, likewise; over TCP it needs ``secret_key`` and ``requesters``. Wrong:
            likewise.
        secret_key: File with the secret key of the daemon (``slipctl keys new`` creates one). Wrong: the daemon does
            not start.
        readers: Directory with the public keys (``*.key``) that may subscribe; None: no key is needed. Wrong: clients
            are not admitted.
        requesters: Directory with the public keys that may send requests, likewise. A client that may do both has its
            key in both directories. Wrong: likewise.
        allow_local_tcp: Serve TCP ports of this machine without keys; every user of the machine can then move the
            gripper. Wrong: true on a machine with other users: each of them can move the gripper.
        requests_hz: Requests per second that one client may send. Wrong: too low, and requests are `busy`; too high,
            and one client can slow down the others.
    """

    publish: str | None = None
    requests: str | None = None
    secret_key: File | None = None
    readers: File | None = None
    requesters: File | None = None
    allow_local_tcp: bool = False
    requests_hz: float = Field(default=50.0, ge=1.0, le=10_000.0)


class Requests(StrictModel):
    """``[requests]``: what clients may request.

    Attributes:
        friction_without_lease: Any client may raise μ of a finger, or name another object, which makes verdicts more
            lenient. With ``[reflex]`` it may also lower μ, which makes the reflex grip harder. False: only the client
            that holds the lease may. Wrong: true, and any client can silence warnings, or crush the object.
        gravity_without_lease: With ``[reflex]``, any client may report gravity, for the program of an arm that never
            holds the lease. False: only the client that holds the lease may. Without ``[reflex]`` no client needs the
            lease for it. Wrong: true, and any client can make the reflex grip harder.
    """

    friction_without_lease: bool = False
    gravity_without_lease: bool = False


class Continuous(StrictModel):
    """``[recording.continuous]``: the whole run, in files that follow each other; the oldest are deleted.

    Each file opens by itself. ``slipd run --record`` takes the place of this.

    Attributes:
        enabled: Record. Wrong: true on a memory card, and its few gigabytes an hour wear it out.
        file_s: Longest time in one file, s. Wrong: too small, and there are many files; too large, and much is deleted
            at once.
        file_bytes: Largest size of one file, bytes. Wrong: likewise.
        keep_files: Number of files that are kept. Wrong: too small, and what happened is deleted before anyone looks.
        keep_bytes: Size of all kept files together, bytes. Wrong: likewise; too large, and ``min_free_bytes`` ends the
            recording.
    """

    enabled: bool = False
    file_s: float = Field(default=600.0, ge=1.0, le=86_400.0)
    file_bytes: int = Field(default=200_000_000, ge=1_000_000)
    keep_files: int = Field(default=200, ge=2)
    keep_bytes: int = Field(default=10_000_000_000, ge=2_000_000)


class Incidents(StrictModel):
    """``[recording.incidents]``: the last seconds, always kept in memory, and saved after a warning or a drop.

    Attributes:
        enabled: Keep the last seconds, and save them. Wrong: false, and nobody can see why an object fell.
        before_s: Time before the warning that is saved, s. Wrong: too large, and the memory grows by about 0.3 MB for
            each second of two fingers.
        after_s: Time after the warning that is saved too, s. Wrong: too small, and the drop is missing.
        level: Least level that counts; the loss of a contact at that level counts too. A grasp that loses its object
            (``grasp.state`` "lost") always counts. Wrong: "caution" saves much that is harmless, "slipping" misses
            warnings that were heeded.
        pause_s: Least time between two savings after warnings, and between two after drops, s. Wrong: too small, and a
            chattering warning pushes out older files.
        keep_files: Number of files that are kept; the oldest are deleted. Wrong: too small, and an incident is deleted
            before anyone looks.
    """

    enabled: bool = False
    before_s: float = Field(default=60.0, ge=1.0, le=600.0)
    after_s: float = Field(default=5.0, ge=0.0, le=60.0)
    level: Literal["caution", "warning", "slipping"] = "warning"
    pause_s: float = Field(default=60.0, ge=1.0, le=86_400.0)
    keep_files: int = Field(default=20, ge=1)


class Recording(StrictModel):
    """``[recording]``: where recordings are kept, and limits of those that clients start.

    ``slipd run --record`` has no limits.

    Attributes:
        directory: Folder of all recordings but that of ``--record``, to which only this user can write; it is created.
            None: ``$SLIPD_STATE_DIR``, else ``$XDG_STATE_HOME/slipd``, else ``~/.local/state/slipd``. Wrong: on a
            network disk, and a lost network costs entries.
        max_bytes: Size of one file, bytes. A recording that reaches it is closed properly within 0.1 s. Wrong: too
            small, and a recording ends before what it should show.
        max_files: Number of files; at this number ``record.start`` is refused. No file is deleted. Wrong: too small,
            and `record.start` is refused.
        min_free_bytes: Free disk space, bytes; below it no recording starts, and a running one ends. Wrong: too small,
            and the disk fills up; too large, and nothing is recorded.
        continuous: See ``[recording.continuous]``. Wrong: see there.
        incidents: See ``[recording.incidents]``. Wrong: see there.
    """

    directory: File | None = None
    max_bytes: int = Field(default=1_000_000_000, ge=1_000_000)
    max_files: int = Field(default=20, ge=1)
    min_free_bytes: int = Field(default=1_000_000_000, ge=0)
    continuous: Continuous = Continuous()
    incidents: Incidents = Incidents()


class Realtime(StrictModel):
    """``[realtime]``: how the host schedules the daemon.

    Attributes:
        priority: Real-time priority of the event loop (SCHED_FIFO); 0: none. From 50 on it would delay the interrupts
            of the sensors' own lines. Where it is not permitted, the daemon runs without and reports it in
            ``status``. Wrong: 0 beside programs that use all processors delays warnings.
    """

    priority: int = Field(default=0, ge=0, le=49)


class Restart(StrictModel):
    """``[restart]``: what a run takes over from the run before it, on the same devices.

    Attributes:
        gap_s: Longest time between both runs, s; 0: nothing is kept. A tare was in use until the first run ended, so it
            may be older. An hour covers a crash, an update and a reboot; a sensor that rested for longer has cooled
            down or was changed. Wrong: too large, and verdicts rest on a zero that has moved; too small, and each
            restart needs a tare of free fingers.
        temperature_k: Largest change of the temperature that a sensor reports since its tare, K. Sensors that report
            none are not checked. The default is a first guess, about the warming of a sensor from switched off to its
            working temperature. Wrong: too large, and verdicts rest on a zero that has moved; too small, and each
            restart needs a tare of free fingers.
    """

    gap_s: float = Field(default=3600.0, ge=0.0, le=604_800.0)
    temperature_k: float = Field(default=10.0, gt=0.0, le=100.0)
