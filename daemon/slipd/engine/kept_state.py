"""What the engine keeps for the next run, and what it takes over from the run before."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from slipd.config import Config
from slipd.engine.device_identity import Identity
from slipd.errors import SlipdError
from slipd.events import StateRestored
from slipd.finger.finger import Finger
from slipd.finger.force_channel import ForceChannel
from slipd.finger.image_channel import ImageChannel
from slipd.gripper.gripper_control import GripperControl
from slipd.signals.tare import Offset
from slipd.stored_state import StoredState, StoredTare, basis_of, read_state, rig_of

_NS = 1_000_000_000
_NOT_USED = "the state of the run before is not used"


class KeptState:
    """Restores the state of the run before, and returns that of this run.

    A tare waits for the first reading of its stream: only then is the device known. It is used where the device, the
    config on which it depends, and its age allow it, unless another was taken meanwhile.

    Args:
        config: The rig.
        boot: Id of this run.
        wall_minus_monotonic_ns: Wall clock less CLOCK_MONOTONIC at the start of the run.
        fingers: The fingers by name.
        gripper: The gripper; None where the config names none.

    Attributes:
        waiting: Tares whose stream has not been read since they were restored, by stream.
        problems: Why a tare that was kept is not used, for people, by stream.
    """

    def __init__(
        self,
        config: Config,
        boot: str,
        wall_minus_monotonic_ns: int,
        fingers: Mapping[str, Finger],
        gripper: GripperControl | None,
    ) -> None:
        self._config, self._boot = config, boot
        self._wall_minus_monotonic_ns = wall_minus_monotonic_ns
        self._gripper = gripper
        self._channels: dict[str, ForceChannel | ImageChannel] = {
            f"{name}.{kind}": channel
            for name, finger in fingers.items()
            for kind in ("wrench", "pad")
            if (channel := finger.channel(kind)) is not None
        }
        self._basis = {name: basis_of(stream) for name, stream in config.streams().items()}
        self._kept: dict[str, tuple[Offset, StoredTare]] = {}
        self.waiting: dict[str, StoredTare] = {}
        self.problems: dict[str, str] = {}

    def restore(self, event: StateRestored, t_ns: int) -> str:
        """Take over what the run before kept.

        Returns:
            Why nothing of it is used, for people; "" where the text can be read.
        """
        try:
            state = None if event.problem else read_state(event.text, self._config)
        except SlipdError as error:
            return f"{_NOT_USED}: {error}"
        if state is None:
            return f"{_NOT_USED}: {event.problem}"
        for name, tare in state.tares.items():
            problem = self._why_not(name, tare, t_ns, same_run=state.boot == self._boot)
            if problem:
                self.problems[name] = f"the stored tare is not used: {problem}"
            else:
                self.waiting[name] = tare if state.boot == self._boot else tare.model_copy(update={"origin": "stored"})
        if state.grip is not None and self._gripper is not None:
            self._gripper.restore(state.grip)
        return ""

    def _why_not(self, name: str, tare: StoredTare, t_ns: int, *, same_run: bool) -> str:
        channel = self._channels.get(name)
        size = channel.tare.current.value.size if channel is not None else 0
        if tare.basis != self._basis.get(name) or not len(tare.offset) == len(tare.std) == size:
            return "the config of the stream is another"
        if tare.gravity_mps2 is not None and len(tare.gravity_mps2) != 3:
            return "it is damaged"
        if same_run:
            return ""
        age_s = (t_ns + self._wall_minus_monotonic_ns - tare.wall_ns) / _NS
        most_s = self._config.restart.tare_age_s
        if age_s < 0.0:
            return "it was taken later than now by the clock of this host"
        return f"it is {age_s:.0f} s old, and restart.tare_age_s is {most_s:g}" if age_s > most_s else ""

    def apply(self, name: str, device: Identity) -> None:
        """Put the tare that waits for a stream in force, now that a reading of it came.

        Args:
            name: The stream.
            device: Its device, as it is known now.
        """
        tare, channel = self.waiting[name], self._channels[name]
        if tare.device and not device.reported:
            return
        del self.waiting[name]
        if channel.tare.current.origin == "measured" or channel.tare.busy:
            return
        if (tare.device or tare.opened) == (device.reported or device.opened):
            channel.restore_tare(self._offset(tare, channel))
        else:
            self.problems[name] = f"the stored tare is not used: it is of {tare.device or tare.opened}"

    def _offset(self, tare: StoredTare, channel: ForceChannel | ImageChannel) -> Offset:
        shape = channel.tare.current.value.shape
        gravity = None if tare.gravity_mps2 is None else np.array(tare.gravity_mps2)
        t_ns = tare.wall_ns - self._wall_minus_monotonic_ns
        value, std = np.reshape(tare.offset, shape), np.reshape(tare.std, shape)
        return Offset(tare.id, value, t_ns, tare.readings, tare.by, std, gravity, tare.origin)

    def text(self, devices: Mapping[str, Identity]) -> str:
        """Return the text of what the next run may take over; ``devices``: the device of each stream."""
        tares = dict(self.waiting)
        for name, channel in self._channels.items():
            offset = channel.tare.current
            if offset.id > 0:
                tares[name] = self._stored(name, offset, devices[name])
        grip = None if self._gripper is None else self._gripper.kept()
        return StoredState(rig=rig_of(self._config), boot=self._boot, tares=tares, grip=grip).model_dump_json()

    def _stored(self, name: str, offset: Offset, device: Identity) -> StoredTare:
        known = self._kept.get(name)
        if known is not None and known[0] is offset:
            return known[1]
        std = np.zeros_like(offset.value) if offset.std is None else offset.std
        stored = StoredTare(
            device=device.reported,
            opened=device.opened,
            basis=self._basis[name],
            id=offset.id,
            wall_ns=(offset.t_ns or 0) + self._wall_minus_monotonic_ns,
            readings=offset.readings,
            by=offset.by,
            offset=offset.value.ravel().tolist(),
            std=std.ravel().tolist(),
            gravity_mps2=None if offset.gravity_mps2 is None else offset.gravity_mps2.tolist(),
            origin="stored" if offset.origin == "stored" else "measured",
        )
        self._kept[name] = offset, stored
        return stored
