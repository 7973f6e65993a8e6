"""What the engine keeps for the next run, and what it takes over from the run before."""

from __future__ import annotations

from typing import Literal, cast

import numpy as np

from slipd.errors import SlipdError
from slipd.events import FirstEvents, HostNotice, LinkUp, StateRestored
from slipd.finger.force_channel import ForceChannel
from slipd.finger.image_channel import ImageChannel
from slipd.gripper.gripper_control import GripperControl
from slipd.gripper.stored_state import StoredGrip, StoredState, StoredTare, basis_of, read_state, rig_of, seal
from slipd.links.device_link import IdentityGuard
from slipd.rig import Rig
from slipd.signals.tare import Offset
from slipd.types.arrays import finite_or_none

_NS = 1_000_000_000
_MINUTE_NS = 60 * _NS
_TOPIC = "state"
_NOT_USED, _TARE_NOT_USED = "the state of the run before is not used", "the stored tare is not used"


class KeptState:
    """Restores the state of the run before, and returns that of this run.

    A tare waits for the first reading of its stream: only then is the device known. It is used where the device, the
    config on which it depends, and the time since the run before allow it, unless another was taken meanwhile.

    Args:
        rig: The rig of this run.

    Attributes:
        waiting: Tares whose stream has not been read since they were restored, by stream.
        problems: Why a tare that was kept is not used, for people, by stream.
    """

    def __init__(self, rig: Rig) -> None:
        self._config, self._boot, self._wall = rig.config, rig.boot, rig.wall
        self._rig_id = rig_of(rig.config)
        self._links, self._fingers, self._gripper, self._named = rig.links, rig.fingers, rig.gripper, rig.named
        self._channels = rig.channels
        self._of_stream = {stream.name: link for link in rig.links.values() for stream in link.streams.values()}
        self._basis = {name: basis_of(stream) for name, stream in rig.config.streams().items()}
        self._kept: dict[str, tuple[Offset, StoredTare]] = {}
        self._until_ns: int | None = None
        self._grip: StoredGrip | None = None
        self.waiting: dict[str, StoredTare] = {}
        self.problems: dict[str, str] = {}

    def restore(self, event: StateRestored, t_ns: int) -> HostNotice:
        """Take over what the run before kept; the notice has the reason why nothing of it is used, "" where it is."""
        try:
            state = None if event.problem else read_state(event.text, self._config)
        except SlipdError as error:
            return HostNotice(_TOPIC, f"{_NOT_USED}: {error}")
        if state is None:
            return HostNotice(_TOPIC, f"{_NOT_USED}: {event.problem}")
        same_run = state.boot == self._boot
        gap_ns = round(self._config.restart.gap_s * _NS) - (self._wall.at_ns(t_ns) - state.kept_wall_ns)
        self._until_ns = None if same_run else t_ns + gap_ns
        gap = "" if same_run else self._why_too_old(state, t_ns)
        for name, tare in state.tares.items():
            if problem := gap or self._why_not(name, tare):
                self.problems[name] = f"{_TARE_NOT_USED}: {problem}"
            else:
                self.waiting[name] = tare if same_run else tare.model_copy(update={"origin": "stored"})
        if state.grip is not None and isinstance(self._gripper, GripperControl) and not gap:
            self._grip = grip = state.grip
            self._gripper.grip.restore(grip, lambda: self._resume(grip))
        return HostNotice(_TOPIC, "")

    def _resume(self, grip: StoredGrip) -> None:
        """Go on with the name of the object, and with what was learned of it: the gripper still holds it.

        What a client of this run stated meanwhile counts instead.
        """
        if self._named.set_by is None:
            self._named.name = grip.named
            for finger in self._fingers.values():
                finger.friction.set_object(grip.named)
        for name, finger in self._fingers.items():
            same = self._named.name == grip.named and finger.friction.set_by is None
            if same and name in grip.friction:
                finger.friction.resume(grip.friction[name])

    def _why_too_old(self, state: StoredState, t_ns: int) -> str:
        gap_s, most_s = (self._wall.at_ns(t_ns) - state.kept_wall_ns) / _NS, self._config.restart.gap_s
        if gap_s < 0.0:
            return "by the clock of this host it is of a later time"
        return f"the run before ended {gap_s:.0f} s ago, and restart.gap_s is {most_s:g}" if gap_s > most_s else ""

    def _why_not(self, name: str, tare: StoredTare) -> str:
        channel = self._channels.get(name)
        if channel is None or tare.basis != self._basis[name]:
            return "the config of the stream is another"
        fits = len(tare.offset) == len(tare.std) == channel.tare.current.value.size
        damaged = not fits or (tare.gravity_mps2 is not None and len(tare.gravity_mps2) != 3)
        return "it is damaged" if damaged else ""

    def apply(self, name: str, t_ns: int) -> None:
        """Put the tare that waits for a stream in force, now that a reading of it came."""
        tare, channel, device = self.waiting[name], self._channels[name], self._of_stream[name].guard
        wanted = tare.device or tare.opened
        if tare.device and not device.reported:
            if self._until_ns is not None:
                return
            wanted = tare.opened  # a recording that began during the run: the device had reported its name before
        del self.waiting[name]
        if channel.tare.current.origin == "measured" or channel.tare.busy:
            return
        if wanted != (device.reported or device.opened):
            self.problems[name] = f"{_TARE_NOT_USED}: it is of {tare.device or tare.opened}"
        elif self._until_ns is not None and t_ns > self._until_ns:
            self.problems[name] = f"{_TARE_NOT_USED}: the device answers too late for restart.gap_s"
        elif warmed := self._warming(name, tare):
            self.problems[name] = f"{_TARE_NOT_USED}: {warmed}"
        else:
            channel.tare.restore(offset := self._offset(tare, channel))
            self._kept[name] = offset, tare  # its temperature stays that of the tare, however often it is restored

    def _warming(self, name: str, tare: StoredTare) -> str:
        """Return how far the sensor's temperature has moved since a tare, if that is too far; else ""."""
        now_c, most_k = self._temperature_c(name), self._config.restart.temperature_k
        if tare.temperature_c is None or now_c is None or abs(now_c - tare.temperature_c) <= most_k:
            return ""
        return f"the sensor had {tare.temperature_c:.1f} °C, has {now_c:.1f}, and restart.temperature_k is {most_k:g}"

    def _temperature_c(self, name: str) -> float | None:
        return finite_or_none(self._of_stream[name].counters.temperature_c)

    def _offset(self, tare: StoredTare, channel: ForceChannel | ImageChannel) -> Offset:
        shape = channel.tare.current.value.shape
        gravity = None if tare.gravity_mps2 is None else np.array(tare.gravity_mps2)
        t_ns = tare.wall_ns - self._wall.minus_monotonic_ns
        value, std = np.reshape(tare.offset, shape), np.reshape(tare.std, shape)
        return Offset(tare.id, value, t_ns, tare.readings, tare.by, std, gravity, tare.origin)

    @property
    def force_n(self) -> float | None:
        """Force of the grip in force, N; None: no gripper, no grip, or not known."""
        return self._gripper.policy.force_n if isinstance(self._gripper, GripperControl) else None

    def first_events(self, t_ns: int) -> FirstEvents:
        """Return what precedes a recording that begins now: the zeros and the grip in force, and the open links."""
        links = (LinkUp(name, link.guard.opened) for name, link in self._links.items() if link.up)
        return StateRestored(self.text(t_ns)), *links

    def text(self, t_ns: int) -> str:
        """Return what the next run may take over, as the text of its `StateRestored`; it changes each minute."""
        tares = dict(self.waiting)
        for name, channel in self._channels.items():
            offset = channel.tare.current
            if channel.tare.known:
                tares[name] = self._stored(name, offset, self._of_stream[name].guard)
        grip = self._gripper.grip.kept() if isinstance(self._gripper, GripperControl) else None
        if grip is not None and grip is not self._grip:
            friction = {name: finger.friction.taught() for name, finger in self._fingers.items()}
            grip = grip.model_copy(update={"named": self._named.name, "friction": friction})
        minute = self._wall.at_ns(t_ns) // _MINUTE_NS * _MINUTE_NS
        state = StoredState(rig=self._rig_id, boot=self._boot, kept_wall_ns=minute, tares=tares, grip=grip)
        return seal(state.model_dump_json())

    def set_wall_clock(self, minus_monotonic_ns: int) -> None:
        """Set the wall clock; a tare keeps the wall time at which it was taken."""
        for name, channel in self._channels.items():
            if channel.tare.known:
                self._stored(name, channel.tare.current, self._of_stream[name].guard)
        self._wall.minus_monotonic_ns = minus_monotonic_ns

    def _stored(self, name: str, offset: Offset, device: IdentityGuard) -> StoredTare:
        known = self._kept.get(name)
        if known is not None and known[0] is offset:
            return known[1]
        std = np.zeros_like(offset.value) if offset.std is None else offset.std
        stored = StoredTare(
            device=device.reported,
            opened=device.opened,
            basis=self._basis[name],
            id=offset.id,
            wall_ns=self._wall.at_ns(offset.t_ns or 0),
            readings=offset.readings,
            by=offset.by,
            offset=offset.value.ravel().tolist(),
            std=std.ravel().tolist(),
            gravity_mps2=None if offset.gravity_mps2 is None else offset.gravity_mps2.tolist(),
            temperature_c=self._temperature_c(name),
            origin=cast("Literal['observed', 'measured', 'stored']", offset.origin),
        )
        self._kept[name] = offset, stored
        return stored
