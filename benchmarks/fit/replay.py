"""Run the rules of slip of the daemon on kept grasps: seconds instead of hours."""

from __future__ import annotations

import importlib
import math
from collections import deque
from collections.abc import Callable, Iterable, Mapping

import numba
import numpy as np
from evaluate.offline_grasp import BEGIN_NS
from evaluate.running import Variant, config_text
from evaluate.worlds import WORLDS
from fit.loose import loose_follow_load
from fit.record import Grasp
from fit.score import Spans, spans_of

from slipd import config
from slipd.fusion.contact_state import ContactState, WrenchUncertainty
from slipd.fusion.load_blocks import GAP_S, RING, forget_load
from slipd.fusion.rows import BLOCK as BLOCKS
from slipd.fusion.rows import Rows, new_rows
from slipd.motion.evidence import REPORTED_NS, Evidence, MotionRisk
from slipd.motion.image_shift import ImageShift
from slipd.signals.pad import PadGeometry
from slipd.types.arrays import Array


class LoadRules:
    """The rules of the load, some constants of which may be replaced.

    Args:
        given: Those constants, as "file.NAME" of `slipd.fusion`.
    """

    def __init__(self, given: Iterable[str]) -> None:
        self._given = sorted(given)
        self._follow = _follower(loose_follow_load(self._given))

    def spans(self, grasp: Grasp, replaced: Mapping[str, float]) -> Spans:
        """Return when the load of a grasp shows slip, with other values of some constants."""
        watch = ContactState(config.Levels(), config.Slip(), math.nan, 0.0)
        slips = np.zeros(len(grasp.load), np.bool_)
        values = np.array([replaced.get(name, _value(name)) for name in self._given])
        drops, ring = np.ascontiguousarray(watch.row["drop"]), new_rows(BLOCKS, RING)
        self._follow(np.ascontiguousarray(grasp.load), drops, ring, slips, values)
        return spans_of(grasp.load[:, 0], slips)


def _value(path: str) -> float:
    file, name = path.split(".")
    return float(vars(importlib.import_module(f"slipd.fusion.{file}"))[name])


def _follower(follow_load: Callable[..., bool]) -> Callable[..., None]:
    """Return a loop over a load in columns of `fit.record.COLUMNS`: does it show slip at each reading?"""

    @numba.njit(error_model="numpy")  # type: ignore[untyped-decorator]
    def follow(load: Array, drops: Rows, ring: Rows, slips: Array, given: Array) -> None:
        drop = drops[0]
        for i in range(len(load)):
            row = load[i]
            t_s, q, exact = row[0], row[2], row[12] > 0.0
            if row[1] == 0.0:
                forget_load(drop)
                continue
            if drop["exact"] and not exact and t_s - drop["last_s"] <= GAP_S:  # as `slipd.fusion.assess` does
                q = math.inf
            elif exact != drop["exact"]:
                forget_load(drop)
                drop["exact"] = exact
            felt = math.nan
            slips[i] = follow_load(drop, ring, t_s, q, row[3], row[4], row[5], row[9], row[10], felt, felt, 0.0, given)

    return follow


def beside_load(grasp: Grasp, world: str) -> Spans:
    """Return when images show slip, as a finger and `slipd.engine.held_motion` follow them."""
    watch = _Beside(grasp, world)
    images = deque(range(len(grasp.seen)))
    for row, touches in enumerate((grasp.load[:, 1] > 0.0).tolist()):
        while images and grasp.seen[images[0], 0] <= row:
            watch.look(images.popleft())
        if not touches:
            watch.forget()
    return watch.spans


class _Beside:
    """Follows the evidence beside the load of one grasp.

    Attributes:
        spans: When it shows slip, s.
    """

    def __init__(self, grasp: Grasp, world: str) -> None:
        self._grasp = grasp
        scene = WORLDS[world].draw(grasp.family, grasp.seed)
        settings = config.parse(config_text(scene, Variant()), "config of a kept grasp")
        wrench, pad = settings.finger["left"].wrench, settings.finger["left"].pad
        assert wrench is not None
        assert pad is not None
        lever_m = math.hypot(*wrench.pad_from_sensor.xyz_m)
        noise = WrenchUncertainty(wrench.force_std_n, math.hypot(wrench.torque_std_nm, lever_m * wrench.force_std_n))
        self._shift = ImageShift(PadGeometry(pad.rows, pad.cols, pad.pitch_m, pad.electrode_m), noise)
        self._risk = MotionRisk(settings.levels.false_alarms_per_hour, {"image_change": self._shift.looks_per_hour})
        self.spans: list[tuple[float, float]] = []

    def look(self, number: int) -> None:
        """Look at an image of the grasp."""
        seen, image = self._grasp.seen[number], self._grasp.images[number].astype(float)
        self._judge(self._shift.update(int(seen[1]), image, tuple(seen[2:].tolist())))

    def forget(self) -> None:
        """Forget the contact: it ended."""
        self._shift.reset()

    def _judge(self, found: Evidence | None) -> None:
        kinds = () if found is None else self._risk.update(found)
        if found is not None and kinds:
            until_ns = self._shift.confirm() if "image_change" in kinds else found.t_ns + REPORTED_NS
            self.spans.append(((found.t_ns - BEGIN_NS) * 1e-9, (until_ns - BEGIN_NS) * 1e-9))


def joined(spans: Spans) -> Spans:
    """Return spans in order of time, and those that overlap as one."""
    found: list[tuple[float, float]] = []
    for begin, end in sorted(spans):
        if found and begin <= found[-1][1]:
            found[-1] = found[-1][0], max(end, found[-1][1])
        else:
            found.append((begin, end))
    return found
