"""A whole config: ``[gripper]``, ``[grasp]``, ``[reflex]`` and all other tables, and what follows from their keys."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from typing import Annotated, Any, Literal

from pydantic import BaseModel, Field, PrivateAttr, Strict

from slipd.config.service_tables import (
    Bus,
    Continuous,
    Incidents,
    Levels,
    Rates,
    Realtime,
    Recording,
    Requests,
    Restart,
)
from slipd.config.stream_tables import Finger, NotNegative, Pad, Pose, Positive, Slip, Stream, Table, Wrench
from slipd.config.value_bounds import Grip, Quaternion, Slew, StrictModel, within
from slipd.devices import DEVICES

STALE_PERIODS = 3.0
"""Periods without a reading after which a stream is stale by default, but not before ``STALE_LEAST_NS``."""

STALE_LEAST_NS = 20_000_000


class Gripper(Stream):
    """``[gripper]``. Every force is the normal force on one pad.

    Attributes:
        force_table: Rows of (device units, N on one pad), both rising; linear between the rows. Only for grippers that
            do not take newtons. Wrong: every force that is set or reported is wrong. Measure it.
        width_table: Rows of (closure 0…1, m between the pads), closure rising and width falling; likewise. The closure
            of a Robotiq is its position byte / 255: a 2F-85 reports 3 when it is open and 230 when it is closed. Wrong:
            widths are wrong, and so are the places of the pads.
        speed_table: Rows of (device units, m/s of the jaws), both rising; None: no request may set ``speed_mps``.
            Wrong: the jaws move at another speed.
        max_force_n: Largest force that a request may set, N; None: no request may move anything. Above ``min_force_n``,
            and within ``force_table``. Wrong: too high, and a request can crush the object; too low, and the raise that
            would hold it is refused.
        min_force_n: Smallest force that a request may set, N. Wrong: too low, and a request can let the object fall.
        step_n: Largest change of the force on a held object at once, N. Wrong: too high, and one request can crush the
            object; too low, and raises take several requests.
        raise_n_per_s: Fastest rise of that force by requests and the reflex together, N/s. Wrong: too high, and a
            faulty client crushes the object quickly; too low, and a raise comes too late.
        lower_n_per_s: Fastest fall of that force, likewise, N/s. Wrong: too high, and a faulty client drops the object
            quickly.
        budget_n: Largest sum of all raises of one grasp by requests, N, and likewise by the reflex; None:
            ``max_force_n``. Wrong: too high, and many small raises crush the object; too low, and the last one is
            refused.
        max_lease_ms: Longest life of a lease without renewal, ms. Wrong: the longer, the later the grip of a dead
            client is free for others.
        lease_end: What happens to moving fingers when a lease runs out: "hold" lets them finish, "stop" stops them
            where they are. Neither opens them. Wrong: with "hold", moving fingers finish a motion whose client is gone.
    """

    force_table: Table | None = None
    width_table: Table | None = None
    speed_table: Table | None = None
    max_force_n: Grip | None = None
    min_force_n: NotNegative | None = None
    step_n: Grip = 2.0
    raise_n_per_s: Slew = 10.0
    lower_n_per_s: Slew = 2.0
    budget_n: Grip | None = None
    max_lease_ms: int = Field(default=200, gt=0, le=200)
    lease_end: Literal["hold", "stop"] = "hold"


class PadPlace(StrictModel):
    """``[grasp.pads.X]``: pose of the pad of a finger in the gripper frame.

    Attributes:
        positions: Rows of (width m, x m, y m, z m): origin of the pad frame at some widths between the pads, width
            rising. Linear between the rows, unknown beyond them. Wrong: the two contacts are put together wrongly:
            `grasp` misjudges load and grip.
        quat_xyzw: Rotation from pad coordinates to gripper coordinates. Wrong: likewise; pads that do not face each
            other are refused.
    """

    positions: list[Annotated[tuple[float, float, float, float], Strict(False)]] = Field(min_length=2)
    quat_xyzw: Quaternion


class ObservedObject(Stream):
    """``[grasp.object]``: what a process of yours observes of the object in the grip; see "External readings".

    Attributes:
        std_m: Least standard deviation of an observed position, m. It holds what the scatter at rest does not show,
            such as an error of the camera's calibration that changes with the pose of the arm. Wrong: too small, and
            errors of the camera count as motion; too large, and slow motion is missed.
    """

    std_m: Positive = 0.001


class Arm(Stream):
    """``[grasp.arm]``: motion of the arm, which a program of yours pushes; see "The arm's motion", docs/arm.md."""


class GraspMotion(StrictModel):
    """``[grasp.motion]``: advice on how fast the arm may go with the object; see "How fast may it go", docs/arm.md.

    Attributes:
        wanted_acceleration_mps2: Largest acceleration of the arm at full speed, m/s²: the speed scale and the needed
            grip force refer to it. Wrong: too low, and the arm is slowed down too little; too high, too much.
        regrip_std_m: How far an object with a name (``object.set``) may be gripped from where it was in the grasp
            before, m, as a standard deviation of each component. Wrong: too low, and a lift may be too fast; too high,
            and the advice before a lift is too slow, or unknown.
    """

    wanted_acceleration_mps2: float = Field(default=3.0, gt=0.0, le=49.0)
    regrip_std_m: float = Field(default=0.01, gt=0.0, le=0.1)


class Grasp(StrictModel):
    """``[grasp]``: two fingers as one grasp; ``pads`` names both.

    Attributes:
        pads: Pose of the pad of each finger. Wrong: see its keys.
        object: Observation of the object by another process, if there is one. Wrong: see its keys.
        arm: Motion of the arm, reported by another process, if there is one. Wrong: see its keys.
        motion: Advice on how fast the arm may go. Wrong: see its keys.
    """

    pads: dict[str, PadPlace] = Field(min_length=2, max_length=2)
    object: ObservedObject | None = None
    arm: Arm | None = None
    motion: GraspMotion = GraspMotion()


class Reflex(StrictModel):
    """``[reflex]``: raises the grip without a request when a finger warns; needs ``[grasp]`` and ``[gripper]``.

    Attributes:
        enabled: The reflex acts. Wrong: false: only clients raise the grip.
        raise_n_per_s: How fast it raises the force on one pad within what ``gripper.step_n`` and
            ``gripper.raise_n_per_s`` leave, N/s. Wrong: too low, and the grip rises too late; too high, and it
            overshoots.
        ceiling_n: Largest force that it sets, N on one pad; None: ``gripper.max_force_n``, which is also the most.
            Wrong: too high, and the object is crushed; too low, and it falls.
        slip_gain: Factor on the present force if a finger slips although the grip should hold, because the assumed μ is
            too high. Wrong: too high, and the object is crushed; too low, and it goes on sliding.
        lead_time_s: Time from a warning to the drop, s; `slipd check` prints how much force the reflex can add in it.
            Wrong: `slipd check` prints a wrong figure; nothing else depends on it.
        calm_s: Time without need after which the reflex lowers the force again, s. Wrong: too short, and the grip is
            lowered while the load still swings.
        lower_n_per_s: How fast it lowers the force to what is needed, N/s, and no faster than
            ``gripper.lower_n_per_s``; 0: never. Wrong: too high, and the grip follows every short calm.
    """

    enabled: bool = False
    raise_n_per_s: Slew = 50.0
    ceiling_n: Grip | None = None
    slip_gain: float = Field(default=1.2, ge=1.0, le=3.0)
    lead_time_s: Annotated[float, within(1e-3, 10.0, "s", "ms")] = 0.1
    calm_s: Annotated[float, within(1e-3, 3600.0, "s", "ms")] = 2.0
    lower_n_per_s: float = Field(default=0.0, ge=0.0)


TABLES: dict[str, type[BaseModel]] = {
    "finger.X": Finger,
    "finger.X.wrench": Wrench,
    "finger.X.wrench.pad_from_sensor": Pose,
    "finger.X.pad": Pad,
    "finger.X.slip": Slip,
    "gripper": Gripper,
    "grasp": Grasp,
    "grasp.pads.X": PadPlace,
    "grasp.object": ObservedObject,
    "grasp.arm": Arm,
    "grasp.motion": GraspMotion,
    "reflex": Reflex,
    "levels": Levels,
    "rates": Rates,
    "bus": Bus,
    "requests": Requests,
    "recording": Recording,
    "recording.continuous": Continuous,
    "recording.incidents": Incidents,
    "realtime": Realtime,
    "restart": Restart,
}
"""Every table of a config file with the model of its keys; ``X`` stands for the name of a finger."""

ADDRESSES = {
    "serial": "the path of a serial port",
    "tcp": "tcp://HOST:PORT",
    "udp": "udp://HOST:PORT",
    "websocket": "ws://HOST:PORT",
    "external": "ipc:///PATH",
    "local": "unix:///PATH",
}
"""Form of the address of a port, by its transport."""


class Config(StrictModel):
    """A whole config file."""

    bus: Bus = Bus()
    requests: Requests = Requests()
    levels: Levels = Levels()
    rates: Rates = Rates()
    finger: dict[str, Finger] = Field(min_length=1)
    gripper: Gripper | None = None
    grasp: Grasp | None = None
    reflex: Reflex = Reflex()
    recording: Recording = Recording()
    realtime: Realtime = Realtime()
    restart: Restart = Restart()
    _text: str = PrivateAttr(default="")

    @property
    def text(self) -> str:
        """The file as it was read."""
        return self._text

    def with_text(self, text: str) -> Config:
        """Store the text that this config was parsed from."""
        self._text = text
        return self

    @property
    def config_id(self) -> str:
        """Identifies the config in messages: the first 12 hexadecimal digits of the SHA-256 of its text."""
        return hashlib.sha256(self.text.encode()).hexdigest()[:12]

    def streams(self) -> dict[str, Stream]:
        """Return all streams by name: ``left.wrench``, ``left.pad``, ``gripper``, ``object``, ``arm``."""
        found: dict[str, Stream | None] = {}
        for name, finger in self.finger.items():
            found |= {f"{name}.wrench": finger.wrench, f"{name}.pad": finger.pad}
        found["gripper"] = self.gripper
        if self.grasp is not None:
            found |= {"object": self.grasp.object, "arm": self.grasp.arm}
        return {name: stream for name, stream in found.items() if stream is not None}


def table_model(path: Sequence[str]) -> type[BaseModel] | None:
    """Return the model of the table at a path, such as ("finger", "left", "pad"); None if there is no such table."""
    for name, model in TABLES.items():
        parts = name.split(".")
        if len(parts) == len(path) and all(part in ("X", key) for part, key in zip(parts, path, strict=True)):
            return model
    return None


def key_path(stream_name: str) -> str:
    """Return the key path of the table of a stream, such as "finger.left.pad" for ``left.pad``."""
    return {"gripper": "gripper", "object": "grasp.object", "arm": "grasp.arm"}.get(
        stream_name, f"finger.{stream_name}"
    )


def transport_of(port: str) -> str:
    """Return the transport of a port, by its address: "serial" where the address is a path."""
    scheme, separator, _ = port.partition("://")
    fits = (transport for transport, form in ADDRESSES.items() if form.startswith(f"{scheme}://"))
    return next(fits, "serial") if separator else "serial"


def stale_after_ns(stream: Stream) -> int:
    """Return the silence, and the age of a reading, beyond which a stream is stale for the verdict, ns."""
    if stream.stale_s is not None:
        return round(stream.stale_s * 1e9)
    return max(round(STALE_PERIODS * 1e9 / stream.rate_hz), STALE_LEAST_NS)


def axes_of(pad: Pad) -> int:
    """Return how many components a taxel of the pad measures; if the device leaves it open, as many as have a scale."""
    return DEVICES[pad.device].axes or len(pad.axis_scale)


def in_newtons(pad: Pad) -> bool:
    """Return whether a pad reads newtons, and not a unit that the config chose."""
    return pad.gain_error is not None or (
        DEVICES[pad.device].measures_newtons and set(map(abs, pad.axis_scale)) == {1.0}
    )


def device_options(stream: Stream) -> dict[str, Any]:
    """Return the options for the device's decoder or session: those of the file, and what other keys imply."""
    device = DEVICES[stream.device]
    options: dict[str, Any] = dict(stream.options)
    if isinstance(stream, Pad) and device.needs_size:
        options |= {"rows": stream.rows, "cols": stream.cols}
    if device.needs_wiring:
        options["wiring"] = transport_of(stream.port)
    if isinstance(stream, Gripper) and device.needs_tables and stream.force_table and stream.width_table:
        keys = ("force_table", "width_table", "speed_table")
        options |= {key: getattr(stream, key) for key in keys}
    return options
