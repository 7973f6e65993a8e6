"""What outlives a run of the daemon: the zeros of the sensors, the grip in force, and what was learned of the object.

The service keeps the text of a `StoredState` in the state folder, and hands it to the engine of the next run as the
event `slipd.events.StateRestored`. The engine alone reads and writes the text, so that a damaged one is judged in one
place, and a replay judges it as the run did.
"""

from __future__ import annotations

import hashlib
import zlib
from typing import Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from slipd.config import Config, Stream
from slipd.errors import SlipdError
from slipd.friction.friction_state import Taught


class _Stored(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)


class StoredTare(_Stored):
    """A tare of one stream.

    Attributes:
        device: Identity that the device reported; "" if it reports none.
        opened: What was opened, e.g. a path or an address.
        basis: `basis_of` the stream's config.
        id: Number of the tare.
        wall_ns: Wall clock when it was taken, ns since 1970.
        readings: Number of averaged readings.
        by: Client that requested it.
        offset: What is subtracted, in the sensor's units and order.
        std: Standard deviation of a single reading, likewise.
        gravity_mps2: As `slipd.signals.tare.Offset.gravity_mps2`.
        origin: Where it came from in the run that kept it; see `slipd.signals.tare.Origin`.
        temperature_c: Temperature that the sensor reported then, °C; None: it reports none.
    """

    device: str
    opened: str
    basis: str
    id: int = Field(ge=0)
    wall_ns: int
    readings: int = Field(ge=0)
    by: str
    offset: list[float]
    std: list[float]
    gravity_mps2: list[float] | None
    origin: Literal["observed", "measured", "stored"]
    temperature_c: float | None = None


class StoredGrip(_Stored):
    """The grip in force when the state was kept. Every force is the normal force on one pad.

    It was in force then. Whether it still is, only the gripper can confirm.

    Attributes:
        force_n: The force in force, N (`GripPolicy.force_n`); the one acknowledged last where a later one is lost.
        requested_n: The force that a client requested last, N; None: none did.
        raised_n: Sum of all raises of this grasp by requests, N: what is spent of the budget.
        reflexed_n: Likewise by the reflex, of its own budget.
        closed_to_m: Commanded width, m; None: not known.
        width_m: Width that the gripper reported, m; None: not known.
        object: What the gripper reported of the object, as `GripperSample.object`.
        reported_n: Force that the gripper reported, N; None: it reports none.
        named: Name of the object, as a client stated it; None: it has no name.
        friction: What was learned of the static and the dynamic friction of this object, by finger.
    """

    force_n: float = Field(ge=0.0)
    requested_n: float | None
    raised_n: float = Field(ge=0.0)
    reflexed_n: float = Field(default=0.0, ge=0.0)
    closed_to_m: float | None
    width_m: float | None
    object: str
    reported_n: float | None
    named: str | None = None
    friction: dict[str, tuple[Taught, Taught]] = {}


class StoredState(_Stored):
    """All that outlives a run.

    Attributes:
        version: Version of the text; another one is not read.
        rig: `rig_of` the config.
        boot: Id of the run that kept it.
        kept_wall_ns: Wall clock when that run was still alive, ns since 1970: the last full minute.
        tares: Tare of each stream that has one.
        grip: The grip in force; None: none, or its force is not known.
    """

    version: Literal[1] = 1
    rig: str
    boot: str
    kept_wall_ns: int
    tares: dict[str, StoredTare] = {}
    grip: StoredGrip | None = None


def seal(body: str) -> str:
    """Return the text of a state in JSON: its CRC-32 in hexadecimal digits, a space, and the JSON."""
    return f"{zlib.crc32(body.encode()):08x} {body}"


def read_state(text: str, config: Config) -> StoredState:
    """Return the state that a text holds.

    Raises:
        SlipdError: The text is damaged, of another version, or of another rig.
    """
    body = text.partition(" ")[2]
    if text != seal(body):
        raise SlipdError("it is damaged: its checksum is wrong")
    try:
        state = StoredState.model_validate_json(body)
    except ValidationError as error:
        found = error.errors(include_url=False, include_input=False)[0]
        place = ".".join(map(str, found["loc"])) or "the text"
        raise SlipdError(f"{place}: {found['msg'][:200]}") from None
    if state.rig != rig_of(config):
        raise SlipdError("it belongs to another rig: its devices or their ports differ")
    return state


def rig_of(config: Config) -> str:
    """Return what identifies a rig: its streams, devices and ports, in 12 hexadecimal digits."""
    streams = config.streams().items()
    return _digest(*(f"{name} {stream.device} {stream.port} {stream.sensor}" for name, stream in streams))


def basis_of(stream: Stream) -> str:
    """Return what identifies the config on which a tare of a stream depends, in 12 hexadecimal digits."""
    return _digest(stream.model_dump_json())


def _digest(*texts: str) -> str:
    return hashlib.sha256("\n".join(texts).encode()).hexdigest()[:12]
