"""Learn friction from the readings of one contact: kernels, and the row that they keep.

Friction carries no more than μ_s, so each required friction q that was measured is a lower bound of μ_s. The q at which
a slip begins is a sample of μ_s, the q of its plateau one of μ_d. Samples are combined as logarithms, because their
errors are relative.
"""

from __future__ import annotations

import math

import numpy as np

from slipd.fusion.compiled import compiled, compiled_part
from slipd.fusion.rows import TOUCHING, UNTRUSTED, Row, Rows
from slipd.types.arrays import Array

Z = 1.645
"""One-sided confidence of 95 %, in standard deviations; the interval between both bounds has 90 %."""
DWELL_S = 0.1
"""A load counts as carried when it lasted this long, s: longer than a vibration or the impact of a pick. The plateau of
a slip is averaged for as long: later the object may stick again while the slip is still reported."""
SCATTER = 0.05
"""Relative standard deviation of static friction from one slip to the next of the same pair. A new grasp of a known
object adds as much: it is gripped at another place."""
ROUGH = 0.1
"""Relative standard deviation of q at a slip that shows no drop of the load: its onset was some time before."""
GAP_S = 0.3
"""After a longer silence nothing is known of the load between, s: three images of a pad that sends ten a second."""
FADING = 0.6
"""Weight of a sample relative to the next one: friction changes with wear, dust and moisture."""
KEPT = 4
"""Samples of each kind that are kept; the next older one would weigh 0.13 of the newest."""

_FLOATS = (
    *("stated", "spread", "most", "object_floor", "carried", "floor", "block_since_s", "block_last_s", "block_sum"),
    *("block_squares", "touched_s", "onset_s", "bound", "low", "high", "dynamic"),
)
_PAIRS = ("object_ln", "object_var", "block_error", "before")

LEARNING = np.dtype(
    [
        *[(name, "f8") for name in _FLOATS],
        *[(name, "f8", (2,)) for name in _PAIRS],
        ("sample_ln", "f8", (2, KEPT)),
        ("sample_var", "f8", (2, KEPT)),
        ("plateau", "f8", (3,)),
        ("taken", "i8", (2,)),
        *[(name, "i8") for name in ("block_count", "onset", "changes")],
        *[(name, "?") for name in ("named", "slipping", "learned")],
    ],
    align=True,
)
"""What is learned of one contact. Pairs are (static, dynamic).

``stated``, ``spread``, ``most``: μ by config or request (NaN: unknown), its relative standard deviation, and the
largest μ that a verdict may use. ``object_…``: knowledge of the named object from earlier grasps; NaN or 0: none.
``floor``: lower bound of μ_s from what was carried since the last slip. ``block_…``: sums of q, its square, and largest
errors (noise, shape) of the readings of half a dwell; ``before``: mean and lower bound of the block before.
``touched_s``: time of the newest reading of the contact that is not UNTRUSTED. ``onset``: what the sample of the
present slip is from: 0 nothing, 1 q when it was noticed, 2 the peak before a drop; ``onset_s``: when it was noticed.
``plateau``: count, sum and largest error of its q. ``bound``: μ for verdicts; ``learned``: it is not the stated one.
``low``, ``high``, ``dynamic``: as in `FrictionState`. ``changes`` counts results."""


@compiled
def learn(readings: Rows, rows: Rows, shape_error: float, teaches_from: int) -> None:
    """Learn from readings in sequence.

    Args:
        readings: Assessed rows of READING, shape (n,).
        rows: One row of LEARNING.
        shape_error: Relative standard deviation of q of a pure spin, by the few taxels that show the pressure.
        teaches_from: Index of the first reading that is trusted. Those before it only end a contact or a slip.
    """
    row = rows[0]
    for k in range(len(readings)):
        reading = readings[k]
        found, contact, phase = reading["assessment"], reading["contact"], reading["phase"]
        q = found["required_friction"]
        if phase == UNTRUSTED:
            _forget_blocks(row)
            continue
        if phase != TOUCHING:
            if row["carried"] > 0.0 or row["taken"][0] > 0 or row["block_count"] > 0:
                end_grasp(rows)
            row["slipping"] = False
            continue
        if reading["t_s"] - row["touched_s"] > GAP_S:
            end_grasp(rows)
        row["touched_s"] = reading["t_s"]
        if k < teaches_from or not 0.0 < q < math.inf:
            row["slipping"] = found["slips"]
            _forget_blocks(row)
            continue
        noise = contact["friction_ratio_std"] / q
        shape = shape_error * max(1.0 - contact["friction_ratio"] / q, 0.0)
        if found["slips"]:
            _slide(rows, reading["t_s"], q, found["peak_required"], found["plateau_required"], noise, shape)
            _forget_blocks(row)
        else:
            _carry(rows, reading["t_s"], q, noise, shape)
        row["slipping"] = found["slips"]


@compiled_part
def _forget_blocks(row: Row) -> None:
    """Forget the open block and the one before it: the load between was not carried at rest, or is not known."""
    row["block_count"], row["before"][0] = 0, math.nan


@compiled_part
def _carry(rows: Rows, t_s: float, q: float, noise: float, shape: float) -> None:
    """Add a reading that does not slip to its block; a block that is full may raise what was carried."""
    row = rows[0]
    error, before = row["block_error"], row["before"]
    if not 0.0 <= t_s - row["block_last_s"] <= GAP_S:
        _forget_blocks(row)
    if row["block_count"] == 0:
        row["block_since_s"], row["block_sum"], row["block_squares"] = t_s, 0.0, 0.0
        error[0], error[1] = 0.0, 0.0
    row["block_count"] += 1
    row["block_last_s"] = t_s
    row["block_sum"] += q
    row["block_squares"] += q * q
    error[0], error[1] = max(error[0], noise), max(error[1], shape)
    if t_s - row["block_since_s"] < 0.5 * DWELL_S:
        return
    count = row["block_count"]
    mean = row["block_sum"] / count
    varies = max(row["block_squares"] / count - mean * mean, 0.0) / (mean * mean)
    std = math.sqrt(max(error[0] * error[0], varies) / count + error[1] * error[1])
    low = mean * math.exp(-Z * std)
    if not math.isnan(before[0]):
        carried, floor = min(mean, before[0]), min(low, before[1])
        changed = carried > row["carried"]
        row["carried"] = max(row["carried"], carried)
        if floor > row["floor"]:
            row["floor"], changed = floor, True
            _discard_disproved(rows)
        if changed:
            combine(rows)
    before[0], before[1] = mean, low
    row["block_count"] = 0


@compiled_part
def _slide(rows: Rows, t_s: float, q: float, peak: float, plateau: float, noise: float, shape: float) -> None:
    """Take samples from a reading that slips: one of μ_s at the onset, and one of μ_d that its plateau refines.

    Without a peak, a sample of μ_s is at most what is stated or lasted: one reading may be a shock.
    """
    row = rows[0]
    lasted, stated = row["before"][0], row["stated"]
    sums = row["plateau"]
    if not row["slipping"]:
        row["onset"], row["onset_s"] = 0, t_s
        sums[0], sums[1], sums[2] = 0.0, 0.0, 0.0
    changed = False
    if peak > 0.0 and row["onset"] < 2:
        var = noise * noise + shape * shape + SCATTER * SCATTER
        _take_sample(rows, 0, peak, var, row["onset"] == 1)
        row["onset"], changed = 2, True
    elif not row["slipping"] and math.isnan(peak) and (lasted > 0.0 or stated > 0.0):
        lasting = lasted if math.isnan(stated) or lasted > stated else stated
        _take_sample(rows, 0, min(q, lasting), ROUGH * ROUGH + shape * shape + SCATTER * SCATTER, False)
        row["onset"], changed = 1, True
    if changed:
        row["floor"] = 0.0  # a later slip shows more than what was carried before
    if plateau > 0.0 and t_s - row["onset_s"] <= DWELL_S:
        sums[0], sums[1] = sums[0] + 1.0, sums[1] + plateau
        sums[2] = max(sums[2], math.hypot(noise, shape))
        _take_sample(rows, 1, sums[1] / sums[0], sums[2] * sums[2] + SCATTER * SCATTER, sums[0] > 1.0)
        changed = True
    if changed:
        combine(rows)


@compiled_part
def _take_sample(rows: Rows, kind: int, q: float, var: float, replaces: bool) -> None:
    """Keep a sample; ``replaces``: it is a better one of the same slip than the newest."""
    row = rows[0]
    lns, variances, samples = row["sample_ln"], row["sample_var"], row["taken"]
    if not replaces:
        samples[kind] += 1
    at = (samples[kind] - 1) % KEPT
    lns[kind, at], variances[kind, at] = math.log(q), var


@compiled_part
def _discard_disproved(rows: Rows) -> None:
    """Discard samples, and knowledge of the object, that are too low for what was carried since: no slip was there."""
    row = rows[0]
    lns, variances, samples = row["sample_ln"], row["sample_var"], row["taken"]
    floor = math.log(row["floor"])
    for k in range(min(samples[0], KEPT)):
        if floor > lns[0, k] + Z * math.sqrt(variances[0, k]):
            variances[0, k] = math.nan
    known, var = row["object_ln"], row["object_var"]
    if floor > known[0] + Z * math.sqrt(var[0] + SCATTER * SCATTER):
        var[0] = math.nan


@compiled_part
def _mean(lns: Array, variances: Array, taken: int, prior_ln: float, prior_var: float) -> tuple[float, float]:
    """Return mean and variance of the logarithm of a coefficient by samples and prior; NaN where nothing is known.

    Newer samples weigh more. Samples that disagree widen the variance. A prior whose interval the samples leave does
    not count.
    """
    total = moment = squares = 0.0
    used, weight = 0, 1.0
    for age in range(min(taken, KEPT)):
        at = (taken - 1 - age) % KEPT
        if not math.isnan(variances[at]):
            w = weight / variances[at]
            total, moment, squares = total + w, moment + w * lns[at], squares + w * lns[at] * lns[at]
            used += 1
            weight *= FADING
    if used == 0:
        return prior_ln, prior_var
    mean, var = moment / total, 1.0 / total
    if used > 1:
        var *= max((squares - moment * mean) / (used - 1), 1.0)
    if not abs(mean - prior_ln) <= Z * math.sqrt(prior_var):
        return mean, var
    both = 1.0 / var + 1.0 / prior_var
    return (mean / var + prior_ln / prior_var) / both, 1.0 / both


@compiled
def combine(rows: Rows) -> None:
    """Combine prior, samples and what was carried into the result.

    The stated μ is a low estimate by its definition in the config, so it is used as it stands until a slip or a
    larger q that was carried contradicts it. A learned μ is the lower bound of the next slip: of the mean, and of the
    scatter from slip to slip.
    """
    row = rows[0]
    stated, spread, floor, most = row["stated"], row["spread"], row["floor"], row["most"]
    known, known_var = row["object_ln"], row["object_var"]
    lns, variances, taken = row["sample_ln"], row["sample_var"], row["taken"]
    prior_ln, prior_var = math.log(stated), spread * spread
    if not math.isnan(known_var[0]):
        prior_ln, prior_var = known[0], known_var[0] + SCATTER * SCATTER
    sampled = not math.isnan(known_var[0])
    for k in range(min(taken[0], KEPT)):
        sampled = sampled or not math.isnan(variances[0, k])
    learned = False
    if spread == 0.0 and not math.isnan(stated):
        mu = low = high = stated
    elif sampled:
        ln, var = _mean(lns[0], variances[0], taken[0], prior_ln, prior_var)
        reach = Z * math.sqrt(var + SCATTER * SCATTER)
        low, high, learned = max(math.exp(ln - reach), floor), max(math.exp(ln + reach), floor), True
        mu = low
    elif not math.isnan(stated):
        learned = floor > stated
        mu, low, high = max(stated, floor), max(stated * math.exp(-Z * spread), floor), stated * math.exp(Z * spread)
        if floor > high:
            high = floor * math.exp(Z * spread)
    else:
        mu, low, high = math.nan, floor if floor > 0.0 else math.nan, math.nan
    dynamic_ln, _ = _mean(lns[1], variances[1], taken[1], known[1], known_var[1] + SCATTER * SCATTER)
    row["bound"], row["low"], row["high"] = most if mu > most else mu, most if low > most else low, high
    row["dynamic"], row["learned"] = math.exp(dynamic_ln), learned
    row["changes"] += 1


@compiled
def end_grasp(rows: Rows) -> None:
    """Keep what was learned of a named object, and forget the grasp."""
    row = rows[0]
    known, known_var, taken = row["object_ln"], row["object_var"], row["taken"]
    lns, variances = row["sample_ln"], row["sample_var"]
    if row["named"]:
        floor = row["floor"]
        row["object_floor"] = floor if taken[0] > 0 else max(row["object_floor"], floor)
        for kind in range(2):
            prior_var = known_var[kind] + SCATTER * SCATTER
            ln, var = _mean(lns[kind], variances[kind], taken[kind], known[kind], prior_var)
            if taken[kind] > 0:
                known[kind], known_var[kind] = ln, var
    begin_grasp(rows)


@compiled
def begin_grasp(rows: Rows) -> None:
    """Start anew from what is stated and what is known of the object."""
    row = rows[0]
    row["carried"], row["floor"] = 0.0, row["object_floor"] * math.exp(-Z * SCATTER)
    row["slipping"], row["onset"] = False, 0
    _forget_blocks(row)
    samples = row["taken"]
    samples[0], samples[1] = 0, 0
    combine(rows)
