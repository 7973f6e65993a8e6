"""One finger: its samples in, a verdict on every force reading out."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from slipd.config import Finger as FingerConfig
from slipd.config import Levels, Stream
from slipd.fusion import (
    Contact,
    Loads,
    SlipDetector,
    SlipSettings,
    Utilisation,
    contact_from_wrench,
    tipping_margin,
    utilisation,
)
from slipd.pipeline.decision import NAMES, STABLE, LevelGate, Verdict, danger_reasons
from slipd.pipeline.image import PadImage, pad_image
from slipd.samples import Array, TactileSample, WrenchSample
from slipd.signals.mounting import Mounting
from slipd.signals.tare import Tare

#: A contact that exists is lost only below this share of the least normal force.
CONTACT_HYSTERESIS = 0.8
STALE_PERIODS = 3.0
STALE_LEAST_NS = 20_000_000
#: The spin is most of the load where translation alone explains less than this share of the utilisation.
ROTATION_SHARE = 0.7
#: Relative gap of the bounds of utilisation: far below what a threshold, or a message, can tell apart.
DECISION_GAP = 1e-6
#: Status words that make a reading's value untrustworthy.
UNTRUSTED = frozenset({"overload", "invalid", "raw"})


@dataclass(slots=True)
class State:
    """What is known of a finger after its newest force reading; None or NaN is unknown."""

    t_ns: int
    verdict: Verdict
    force_n: Array | None = None
    torque_nm: Array | None = None
    contact: Contact | None = None
    x: Array | None = None
    y: Array | None = None
    loads: Loads | None = None
    utilisation: Utilisation | None = None
    tipping_margin_m: float = math.nan
    model: str = "none"
    status: tuple[str, ...] = ()


class Finger:
    """One finger of the gripper.

    Args:
        name: Its name.
        config: ``[finger.X]``.
        levels: ``[levels]``.
    """

    def __init__(self, name: str, config: FingerConfig, levels: Levels) -> None:
        self.name = name
        self.config = config
        self.image: PadImage | None = pad_image(config)
        self.wrench_tare = Tare(np.zeros(6)) if config.wrench is not None else None
        self.state = State(0, Verdict("unknown", ("stale",)))
        self._levels = levels
        self._gate = LevelGate(levels)
        self._mounting = _mounting(config)
        wrench = config.wrench
        self._noise = (0.0, 0.0) if wrench is None else (wrench.force_std_n, wrench.torque_std_nm)
        self._stale_ns = stale_after_ns(wrench or config.pad)
        self._image_stale_ns = stale_after_ns(config.pad) if config.pad is not None else 0
        settings = SlipSettings(**config.slip.model_dump())
        self._translation_slip, self._rotation_slip = SlipDetector(settings), SlipDetector(settings)
        self._in_contact = False
        self._free = False
        self._last_ns: int | None = None

    @property
    def tare(self) -> Tare:
        """The tare that force readings pass."""
        if self.wrench_tare is not None:
            return self.wrench_tare
        if self.image is None:
            raise ValueError(f"finger {self.name} has no stream")
        return self.image.tare

    def pressed(self) -> bool | None:
        """Whether something presses on the pad; None where that is not known.

        A force sensor that was never tared reads its own bias as a contact, so until then only the image counts.
        """
        pad = self.config.pad
        tared = self.tare.current.id > 0 or (self.wrench_tare is None and pad is not None and bool(pad.tare))
        shown = self._shows_contact()
        if shown or (tared and self._in_contact):
            return True
        if self.state.contact is None:
            return None
        return False if tared else shown

    def age_s(self, t_ns: int) -> float | None:
        """Age of the newest force reading, s; None before the first."""
        return None if self._last_ns is None else (t_ns - self._last_ns) * 1e-9

    def begin_tare(self, t_ns: int, seconds: float) -> None:
        """Starts to average the unloaded readings of the force stream."""
        self.tare.begin(t_ns, seconds)

    def take_wrench(self, sample: WrenchSample) -> State:
        """Decides on a reading of the force sensor."""
        if self.wrench_tare is None or self._mounting is None:
            raise ValueError(f"finger {self.name} has no force sensor")
        torque = np.full(3, math.nan) if sample.torque_nm is None else sample.torque_nm
        trusted = UNTRUSTED.isdisjoint(sample.status)
        raw = self.wrench_tare.apply(np.concatenate((sample.force_n, torque)), sample.t_ns, trusted=trusted)
        force, torque = self._mounting.to_pad(raw[:3], raw[3:])
        return self._decide(sample.t_ns, force, torque, sample.status)

    def take_tactile(self, sample: TactileSample) -> State | None:
        """Takes an image; decides on it where its taxels are what measures the force."""
        if self.image is None:
            return None
        self.image.take(sample, known_free=self._free)
        if self.wrench_tare is not None:
            return None
        wrench = self.image.wrench()
        return None if wrench is None else self._decide(sample.t_ns, *wrench, sample.status)

    def on_time(self, t_ns: int) -> State | None:
        """Notices that the force stream fell silent; None where nothing changed."""
        if self.state.verdict.reasons == ("stale",):
            return None
        if self._last_ns is not None and t_ns - self._last_ns <= self._stale_ns:
            return None
        return self.lose(t_ns)

    def disconnect(self, t_ns: int) -> State:
        """The force stream ended: a tare that is being measured would average what lies before and behind."""
        self.tare.abort()
        return self.lose(t_ns)

    def disconnect_image(self) -> None:
        """The image stream ended."""
        if self.image is not None:
            self.image.forget()

    def lose(self, t_ns: int) -> State:
        """Forgets what the force stream told: from now on the verdict is unknown."""
        self._end_contact()
        self._free = False
        self.state = State(t_ns, Verdict("unknown", ("stale",)))
        return self.state

    def _decide(self, t_ns: int, force: Array, torque: Array, status: tuple[str, ...]) -> State:
        self._last_ns = t_ns
        least = self.config.min_normal_n * (CONTACT_HYSTERESIS if self._in_contact else 1.0)
        force_std, torque_std = self._noise
        contact = contact_from_wrench(
            force, torque, min_normal_n=least, force_std_n=force_std, torque_std_nm=torque_std
        )
        state = State(t_ns, Verdict("unknown", ()), force, torque, status=status)
        self._free = False
        untrusted = sorted(UNTRUSTED.intersection(status))
        if untrusted or not np.isfinite(force).all() or not np.isfinite(torque).all():
            state.verdict = Verdict("unknown", tuple(untrusted) or ("not_finite",))
        elif not contact.valid:
            self._end_contact()
            self._free = True
            state.contact = contact
            state.verdict = Verdict("no_contact", ())
        else:
            self._in_contact = True
            state.contact = contact
            self._judge(state, contact)
        self.state = state
        if self.tare.busy and self.pressed():
            self.tare.abort()
        return state

    def _judge(self, state: State, contact: Contact) -> None:
        """Fills in the verdict of a valid contact."""
        mu = self.config.mu
        found = self._fresh_loads(state.t_ns, contact)
        if found is not None:
            state.x, state.y, state.loads = found
            state.tipping_margin_m = tipping_margin(state.x, state.y, contact.centroid_m)
        if mu is None:
            state.verdict = Verdict("unknown", ("no_mu",))
            return
        translation = contact.friction_ratio / mu
        if found is None:
            state.model = "translation"
            slips = self._slips(state.t_ns, contact, translation, translation)
            state.verdict = self._without_image(translation, slips)
            return
        x, y, loads = found
        state.model = "exact"
        before = self.state.utilisation
        state.utilisation = used = utilisation(
            x,
            y,
            loads.loads,
            mu,
            contact.tangential_n,
            contact.spin_nm,
            contact.centroid_m,
            start=None if before is None else before.twist,
            gap=DECISION_GAP,
        )
        slips = self._slips(state.t_ns, contact, used.value, translation)
        state.verdict = self._with_image(state, used, translation, slips)

    def _with_image(self, state: State, used: Utilisation, translation: float, slips: bool) -> Verdict:
        if math.isnan(used.value):
            return Verdict("unknown", ("not_finite",))
        step = self._gate.update(used.upper)
        reasons = danger_reasons(used.value, translation, self._levels.caution) if step > STABLE else ()
        tips = self._tips(state)
        if tips > STABLE:
            step, reasons = max(step, tips), (*reasons, "tipping")
        if slips:
            return Verdict("slipping", ("slip_detected", *reasons))
        return Verdict(NAMES[step], reasons)

    def _without_image(self, translation: float, slips: bool) -> Verdict:
        """Translation alone can only prove a grip unsafe, never safe."""
        unsafe = self._gate.update(translation) == len(NAMES) - 1
        reasons = ("translation",) if unsafe else ("rotation_unobserved",)
        if slips:
            return Verdict("slipping", ("slip_detected", *reasons))
        return Verdict("warning" if unsafe else "unknown", reasons)

    def _tips(self, state: State) -> int:
        """Step that the tipping margin asks for: taxels sense over a cell, so the hull is uncertain by half a pitch."""
        contact, image = state.contact, self.image
        if contact is None or image is None:
            return STABLE
        noise = 2.0 * float(contact.centroid_std_m.max())
        outside = -(state.tipping_margin_m + noise) / (0.5 * image.geometry.pitch_m)
        return STABLE + (outside > 0.0) + (outside > 1.0)

    def _slips(self, t_ns: int, contact: Contact, used: float, translation: float) -> bool:
        """Watches force and spin; the spin only where it is most of the load, for else its fall is noise."""
        t_s = t_ns * 1e-9
        turning = used if translation < ROTATION_SHARE * used else math.nan
        translates = self._translation_slip.update(t_s, contact.tangential_norm_n, contact.normal_n, used)
        rotates = self._rotation_slip.update(t_s, abs(contact.spin_nm), contact.normal_n, turning)
        return translates or rotates

    def _shows_contact(self) -> bool | None:
        """What a fresh image says beside the force sensor; taxels that are the force sensor say nothing beside it."""
        image = self.image
        if image is None or self.wrench_tare is None or not self._is_fresh(image, self.state.t_ns):
            return None
        return image.shows_contact()

    def _is_fresh(self, image: PadImage, t_ns: int) -> bool:
        return image.t_ns is not None and t_ns - image.t_ns <= self._image_stale_ns

    def _fresh_loads(self, t_ns: int, contact: Contact) -> tuple[Array, Array, Loads] | None:
        image = self.image
        if image is None or not self._is_fresh(image, t_ns):
            return None
        return image.loads(contact)

    def _end_contact(self) -> None:
        self._in_contact = False
        self._gate.reset()
        self._translation_slip.reset()
        self._rotation_slip.reset()


def stale_after_ns(stream: Stream | None) -> int:
    """Age at which a stream is stale for the verdict."""
    if stream is None:
        return 0
    return max(round(STALE_PERIODS * 1e9 / stream.rate_hz), STALE_LEAST_NS)


def _mounting(config: FingerConfig) -> Mounting | None:
    wrench = config.wrench
    if wrench is None:
        return None
    return Mounting(wrench.pad_from_sensor.xyz_m, wrench.pad_from_sensor.quat_xyzw, wrench.sign)
