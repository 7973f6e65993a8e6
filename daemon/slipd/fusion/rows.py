"""The rows that kernels fill and callers read: NumPy structured dtypes, so that every number has a name.

A dtype is part of a kernel's compiled signature. Kernels address fields as ``rows[i]["t_s"]``, which compiled code and
plain NumPy understand alike. Python code reads whole columns (``rows["phase"].tolist()``) or one row
(``rows.item(i)``, a tuple in the order of the fields): a single field of a single row costs as much as a whole row.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Rows = NDArray[np.void]
Row = np.void
"""One of them, as kernels hand it on."""

PENDING, TOUCHING, FREE, PULLED, LATE, UNTRUSTED = range(6)
"""Phase of a reading. Kernels find TOUCHING, FREE or PULLED for those that are PENDING.
PULLED: the normal force is clearly negative, which no contact gives, or was lately. LATE: too old; ends the contact.
UNTRUSTED: shows nothing, and is skipped."""
STABLE, CAUTION, WARNING = range(3)
"""Steps of a margin that shrinks; the level of a contact that holds is its step + 1."""
NO_CONTACT, SLIPPING, UNKNOWN = 0, 4, 5
"""Level codes beside those."""
STUCK, GARBAGE, INTERMITTENT, NOT_FINITE = 1, 2, 4, 8
"""Faults of a reading, as bits of its ``doubts``; see `slipd.signals.frozen`."""
LOAD_DROP_BIT = 1
"""Bit of the evidence "load_drop", see `slipd.motion.evidence.EVIDENCE`."""
UNSOLVED = -1
"""``kind`` of a utilisation that was not solved, because there is no image or no coefficient of friction."""

_FLOAT, _INTEGER, _FLAG = "f8", "i8", "?"


def _floats(*names: str) -> list[tuple[str, str]]:
    return [(name, _FLOAT) for name in names]


CONTACT = np.dtype(
    [
        *_floats("cx_m", "cy_m", "cx_std_m", "cy_std_m", "normal_n", "fx_n", "fy_n", "spin_nm"),
        *_floats("friction_ratio", "friction_ratio_std"),
        ("valid", _FLAG),
    ],
    align=True,
)
"""`slipd.fusion.contact.Contact`, field by field; NaN but for the forces where ``valid`` is false."""

TORQUE_LIMIT = np.dtype(
    [*_floats("torque_nm", "lower_nm", "upper_nm"), ("pole_m", _FLOAT, (2,)), ("kind", _INTEGER)], align=True
)
"""Torque limit of a frame, with certified bounds; ``kind`` is an index of `slipd.fusion.limit.solve.KINDS`."""

UTILISATION = np.dtype(
    [
        *_floats("value", "lower", "upper"),
        ("pole_m", _FLOAT, (2,)),
        ("twist", _FLOAT, (3,)),
        ("kind", _INTEGER),
    ],
    align=True,
)
"""Utilisation of a frame or reading, with certified bounds; ``twist`` is the motion (2) + (1) that would begin."""

ASSESSMENT = np.dtype(
    [
        ("level", _INTEGER),
        ("friction_step", _INTEGER),
        ("tipping_step", _INTEGER),
        ("utilisation_upper", _FLOAT),
        ("slips", _FLAG),
        ("tipping_by_unknown_load", _FLAG),
        ("evidence", _INTEGER),
        *_floats("required_friction", "peak_required", "plateau_required", "drop_surprise"),
    ],
    align=True,
)
"""Verdict on a reading, see `slipd.fusion.contact_state.Assessment`."""

READING = np.dtype(
    [
        ("wrench", _FLOAT, (6,)),
        ("t_s", _FLOAT),
        ("t_ns", _INTEGER),
        ("doubts", _INTEGER),
        ("phase", _INTEGER),
        ("contact", CONTACT),
        ("tipping_margin_m", _FLOAT),
        ("utilisation", UTILISATION),
        ("assessment", ASSESSMENT),
    ],
    align=True,
)
"""A force reading on its way to a verdict: the sensor's wrench goes in, each kernel fills its own part.
``wrench`` is (F, M) in N and N·m, of the sensor until `slipd.fusion.streaming.move_to_pad` moves it into the pad frame;
M is NaN where the sensor measures none. ``t_s`` and ``t_ns`` are the same time. ``tipping_margin_m`` is NaN without an
image."""

CONDITIONS = np.dtype(
    [
        ("matrix", _FLOAT, (6, 6)),
        ("offset", _FLOAT, (6,)),
        ("weight", _FLOAT, (6,)),
        *_floats("begins_n", "lasts_n", "pulled_n", "force_std_n", "torque_std_nm", "unknown_n", "unknown_nm"),
        ("zero_known", _FLAG),
        *_floats("mu", "spin_scale", "half_pitch_m", "caution", "warning", "hysteresis"),
        ("gravity_mps2", _FLOAT, (2,)),
        *_floats("turn_radps", "gravity_s", "gravity_lasts_s"),
    ],
    align=True,
)
"""Conditions in force for the readings of one contact: what changes rarely, written by the event that changes it.

``matrix``, ``offset``, ``weight``: a wrench of the sensor is matrix · (wrench - offset) - weight in the pad frame.
A contact begins at the normal force ``begins_n`` and lasts down to ``lasts_n``; below ``-pulled_n`` it is PULLED.
``force_std_n`` and ``torque_std_nm`` are the noise of a component, ``unknown_n`` and ``unknown_nm`` what the unknown
weight of the finger may add. Without ``zero_known``, readings show neither contact nor its absence. ``mu``: NaN if
unknown; ``spin_scale``: how many times as much friction a spin uses. ``caution``, ``warning`` and ``hysteresis`` are
thresholds of the level. ``gravity_mps2`` is the apparent gravity along X and Y of the pad by the motion of the arm, and
``turn_radps`` its angular velocity about the normal of the pad, both at ``gravity_s``; they are valid for readings at
most ``gravity_lasts_s`` away from it."""

MEMORY = np.dtype(
    [
        ("in_contact", _FLAG),
        ("twist", _FLOAT, (3,)),
        *_floats("moving_until_s", "pulled_s"),
        ("moving_evidence", _INTEGER),
        ("step", _INTEGER),
        ("tipping_step", _INTEGER),
        ("settled", _FLOAT),
        ("held_s", _FLOAT, (2,)),
        ("tipping_held_s", _FLOAT, (2,)),
    ],
    align=True,
)
"""What is kept of one contact from read to read, without the course of its load: whether the newest reading that could
be trusted touches, and the twist of its utilisation (NaN: none). ``pulled_s`` is when the normal force was clearly
negative last. ``held_s`` is when the load was last within the
hysteresis of CAUTION and of WARNING, ``tipping_held_s`` when the tipping margin asked for them. ``settled`` is the
utilisation that counts."""

DROP = np.dtype(
    [
        *_floats("least_drop", "window_s", "hold_s", "least_surprise"),
        *_floats("last_s", "end_s", "dt", "q", "normal", "fx", "fy", "gx", "gy", "turn", "std"),
        *_floats("top", "smooth", "carried", "white", "rough", "swing", "crest", "trough", "seen"),
        *_floats("since_s", "most", "peak", "plateau", "surprise"),
        ("n", _INTEGER),
        ("block", _INTEGER),
        ("count", _INTEGER),
        ("gap", _INTEGER),
        ("unfelt", _INTEGER),
        ("sliding", _FLAG),
        ("exact", _FLAG),
    ],
    align=True,
)
"""Settings and state of `slipd.fusion.load_drop`: the open block, running means and noise, and the slip under way.

``seen`` is the share of the last blocks that have readings, ``gap`` the distance of the last two that have, in blocks,
``unfelt`` the last block for which the motion of the arm was not known.
"""

BLOCK = np.dtype(
    _floats("q", "q2", "normal", "fx", "fy", "gx", "gy", "turn", "top", "carried", "rough", "swing"), align=True
)
"""A block of readings in the ring of `slipd.fusion.load_drop`: sums up to it, and means and noise after it."""

PASTS = 128
"""Forces that are kept: the longest scan of a pad takes a tenth of a second, and they are a millisecond apart."""
PAST = np.dtype([("t_ns", _INTEGER), ("wrench", _FLOAT, (6,))], align=True)
"""A reading of the recent past, in the pad frame."""
FORCES = np.dtype([*_floats("low_n", "high_n"), ("count", _INTEGER), ("past", PAST, (PASTS,))], align=True)
"""Forces that could be trusted: the range of the normal force since the newest image, and a ring of the last ones."""


def new_rows(dtype: np.dtype[Any], count: int) -> Rows:
    """Make ``count`` rows of zeros.

    NumPy's own ``zeros`` visits every field of the dtype first, which costs more than the work on one reading.
    """
    return np.ndarray(count, dtype, bytearray(count * dtype.itemsize))
