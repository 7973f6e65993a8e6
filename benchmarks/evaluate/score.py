"""The definition of every metric, for one run: what was published, held against what really happened.

Times are those at which a message left the engine. An *alarm* is the level "warning" or "slipping". Gross slip is
defined in `evaluate.truth`. One that begins within `LATE_S` of the end of another belongs to it: only its time counts,
as sliding time.

- **warned**: an alarm is in force at the onset of a gross slip. The share is that of the first gross slips of the runs,
  or, where it says so, of all later ones. Its **lead** is the time since that alarm began, without a pause.
- **oracle of the warnings**: it is told the true λ at every instant, but not the future. Its warning begins when λ
  first reaches `ORACLE_USED`, and ends when λ falls below `ORACLE_BEGIN`. A lower threshold would give false warnings
  to a user whose μ is 10 % too low: that user sees `SAFE` as `ORACLE_USED`. Its lead is the time from the begin of its
  warning to the onset. It does not warn of an object that slides at a λ below its threshold, because partial slip
  weakened the friction.
- **latency** of a gross slip of `PROMPT_S` or longer: from the onset to the first time that the level is "slipping"; 0
  where it is so already; infinite where that never comes before the slip ends. **path**: how far the contact slides
  until then.
- **missed**: a gross slip of `PROMPT_S` or longer, without "slipping" in its first `PROMPT_S`. **silent**: likewise
  without any alarm.
- **false slipping**: the level becomes "slipping" at a time that is not within a gross slip, nor up to `EARLY_S`
  before one or `LATE_S` after one. **closing**: a run in which that happens while the grip closes. **early**: a run in
  which it happens later, and before the first gross slip or in a run without one.
- **false warning**: an alarm begins while the true λ has been below `SAFE` for `SETTLED_S`, and not from `EARLY_S`
  before a gross slip to `LATE_S` after it. Both are counted against the time in contact in which they can happen.
- **sliding time**: of gross slips, what is beyond their first `PROMPT_S`; the shares of it during which the level is
  "slipping", and during which it is "stable" or "no contact".
- **changes on the way**: changes of level from the first level in contact to the onset of the first gross slip.
  **changes in steady holds**: those in the part of a run in which the load is at rest, and its duration.
- **utilisation error**: |q / q_true − 1| of the required friction q = λ μ of a message and of the truth at its
  acquisition time, wherever a message has one, the true λ is between `LEAST_USED` and 1, the pad bears `LEAST_GRIP_N`
  or more, and nothing slides nor did in the last `LATE_S`. It does not depend on μ.
- **grip error**: ``grip_needed_n`` over the grip force that really holds the load times the configured safety factor,
  less 1, at the same times.
- **visible**: the oracle of the fall finds the slip. It is told the onset, and compares the mean of the measured q over
  the `ORACLE_S` before it with that over the `ORACLE_S` that begin 20 ms after it. The slip is visible if the second
  mean is lower by 3 standard errors or more; the noise is that of q before the onset. No detector of a fall can find a
  slip that is not visible, but other evidence may show that the object moves. Its **path** is how far the contact
  slides until the second mean, over the second half of the time since the onset, is lower by as much.
- **overstay**: how long after the end of a gross slip the level is still "slipping".
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from evaluate.reports import NO_CONTACT, SLIPPING, STABLE, UNKNOWN, WARNING, Reports, Span, merged_alarms
from evaluate.truth import Episode, Truth
from numpy.typing import NDArray

from slipd.types.arrays import Array

PROMPT_S = 0.1
EARLY_S, LATE_S = 0.02, 0.25
SAFE, SETTLED_S = 0.7, 0.03
LEAST_USED = 0.3
STATED_LOW = 0.9
"""μ of the user whom the oracle of the warnings must give no false warnings, over the true one."""
ORACLE_BEGIN, ORACLE_USED = 0.5, SAFE / STATED_LOW
ORACLE_S, ORACLE_AFTER_S, ORACLE_FIRST_S, ORACLE_ERRORS = 0.04, 0.02, 0.01, 3.0
SHORT = 0.05
"""A grip force counts as too small if it is short of the true need by more than this."""
LEAST_GRIP_N = 1.0
"""Below this grip force on the pad no utilisation is compared: the contact has just begun, or ends."""


@dataclass(frozen=True, slots=True)
class EpisodeScore:
    """One gross slip.

    Attributes:
        first: It is the first of its run; the others were preceded by one that ended `LATE_S` before, or earlier.
        long: It lasts `PROMPT_S` or longer.
        warned: See the module.
        lead_s: NaN without a warning.
        oracle_lead_s: Of the oracle of the warnings; NaN where it does not warn.
        latency_s: Infinite where it was not reported.
        path_m: NaN where it was not reported.
        slid_m: How far the contact slides in all.
        oracle_path_m: How far it slides until the oracle of the fall finds the slip; infinite where it does not.
        missed: See the module.
        silent: Likewise.
        visible: See the module.
        overstay_s: NaN where another slip follows before the level ends.
    """

    first: bool
    long: bool
    warned: bool
    lead_s: float
    oracle_lead_s: float
    latency_s: float
    path_m: float
    slid_m: float
    oracle_path_m: float
    missed: bool
    silent: bool
    visible: bool
    overstay_s: float


@dataclass(frozen=True, slots=True, eq=False)
class RunScore:
    """One run of one scene with one config."""

    episodes: list[EpisodeScore]
    closing: bool
    early: bool
    false_slipping: int
    quiet_s: float
    false_warnings: int
    safe_s: float
    sliding_s: float
    sliding_seen_s: float
    sliding_reported_s: float
    sliding_stable_s: float
    changes_before: int | None
    steady_changes: int
    steady_s: float
    unknown_s: float
    used_errors: Array = field(repr=False)
    grip_errors: Array = field(repr=False)


def score(truth: Truth, reports: Reports, *, steady: tuple[float, float] | None, closed_s: float) -> RunScore:
    """Score one run.

    Args:
        truth: What happened.
        reports: What was published.
        steady: From when to when the load is at rest, s; None if it never is.
        closed_s: From then on the grip is closed, s.
    """
    end_s = float(truth.t_s[-1])
    spans, episodes = reports.spans(end_s), truth.episodes()
    first_s = episodes[0].begin_s if episodes else math.inf
    slips = [s.begin_s for s in spans if s.level == SLIPPING and not _near_slip(s.begin_s, episodes)]
    used, grip = _errors(truth, reports, episodes)
    safe = _safe(truth, episodes)
    beyond = [Episode(e.begin_s + PROMPT_S, e.end_s) for e in episodes if e.end_s > e.begin_s + PROMPT_S]
    return RunScore(
        episodes=[_episode(k, episodes, spans, truth, reports) for k in range(len(episodes)) if _is_new(k, episodes)],
        closing=any(s < closed_s for s in slips),
        early=any(closed_s <= s < first_s for s in slips),
        false_slipping=len(slips),
        quiet_s=float(truth.step_s[_quiet(truth, episodes)].sum()),
        false_warnings=sum(bool(safe[_index(truth, s.begin_s)]) for s in merged_alarms(spans)),
        safe_s=float(truth.step_s[safe].sum()),
        sliding_s=sum(e.end_s - e.begin_s for e in beyond),
        sliding_seen_s=sum(e.end_s - e.begin_s for e in beyond if _visible(reports, e.begin_s - PROMPT_S)),
        sliding_reported_s=sum(_overlap(spans, e, (SLIPPING,)) for e in beyond),
        sliding_stable_s=sum(_overlap(spans, e, (STABLE, NO_CONTACT)) for e in beyond),
        changes_before=_changes(spans, 0.0, first_s) if episodes else None,
        steady_changes=_changes(spans, *steady) if steady else 0,
        steady_s=steady[1] - steady[0] if steady else 0.0,
        unknown_s=_overlap(spans, Episode(*steady), (UNKNOWN,)) if steady else 0.0,
        used_errors=used,
        grip_errors=grip,
    )


def _episode(k: int, episodes: list[Episode], spans: list[Span], truth: Truth, reports: Reports) -> EpisodeScore:
    begin_s, end_s = episodes[k]
    soon = Episode(begin_s, begin_s + PROMPT_S)
    long = end_s - begin_s >= PROMPT_S
    alarms = merged_alarms(spans)
    before = [a for a in alarms if a.begin_s < begin_s <= a.end_s]
    slipping = [s for s in spans if s.level == SLIPPING and s.end_s > begin_s and s.begin_s <= end_s]
    reported_s = max(slipping[0].begin_s, begin_s) if slipping else math.inf
    last = [s.end_s for s in spans if s.level == SLIPPING and s.begin_s <= end_s < s.end_s]
    followed = k + 1 < len(episodes) and last and episodes[k + 1].begin_s < last[0]
    return EpisodeScore(
        first=k == 0,
        long=long,
        warned=bool(before),
        lead_s=begin_s - before[0].begin_s if before else math.nan,
        oracle_lead_s=_oracle_lead_s(truth, begin_s),
        latency_s=reported_s - begin_s,
        path_m=truth.path_m(begin_s, reported_s) if slipping else math.nan,
        slid_m=truth.path_m(begin_s, end_s),
        oracle_path_m=_oracle_path_m(truth, reports, k, episodes),
        missed=long and not _overlap(spans, soon, (SLIPPING,)),
        silent=long and not _overlap(alarms, soon, (WARNING,)),
        visible=_visible(reports, begin_s),
        overstay_s=math.nan if followed or end_s >= truth.t_s[-1] else (last[0] - end_s if last else 0.0),
    )


def _oracle_lead_s(truth: Truth, onset_s: float) -> float:
    """Return how long before an onset the true λ reached `ORACLE_USED`; NaN where it did not."""
    used = truth.utilisation[: np.searchsorted(truth.t_s, onset_s)]
    low = np.flatnonzero(used < ORACLE_BEGIN)
    begin = int(low[-1]) if low.size else 0
    reached = np.flatnonzero(used[begin:] >= ORACLE_USED)
    return onset_s - float(truth.t_s[begin + reached[0]]) if reached.size else math.nan


def _oracle_path_m(truth: Truth, reports: Reports, k: int, episodes: list[Episode]) -> float:
    """Return how far a slip gets until the oracle finds it, which sees the fall over ever longer times."""
    begin_s, end_s = episodes[k]
    for after_s in np.arange(ORACLE_FIRST_S, end_s - begin_s, ORACLE_FIRST_S / 2.0).tolist():
        if _visible(reports, begin_s, after_s / 2.0, after_s / 2.0):
            return truth.path_m(begin_s, begin_s + after_s)
    return math.inf


def _visible(reports: Reports, onset_s: float, after_s: float = ORACLE_AFTER_S, seconds: float = ORACLE_S) -> bool:
    """Return whether q falls at a known onset by more than its noise, from ``after_s`` on for some ``seconds``."""
    at, q = reports.acquired_s, reports.required
    before = q[(at >= onset_s - ORACLE_S) & (at < onset_s)]
    after = q[(at >= onset_s + after_s) & (at < onset_s + after_s + seconds)]
    before, after = before[np.isfinite(before)], after[np.isfinite(after)]
    if before.size < 4 or after.size < (4 if seconds >= ORACLE_S else 2):
        return False
    noise = float(np.diff(before).std()) / math.sqrt(2.0)
    error = noise * math.sqrt(1.0 / before.size + 1.0 / after.size)
    return bool(before.mean() - after.mean() > ORACLE_ERRORS * error)


def _is_new(k: int, episodes: list[Episode]) -> bool:
    """Return whether a slip is not the tail of the one before, which is still reported."""
    return k == 0 or episodes[k].begin_s - episodes[k - 1].end_s > LATE_S


def _near_slip(t_s: float, episodes: list[Episode]) -> bool:
    return any(e.begin_s - EARLY_S <= t_s <= e.end_s + LATE_S for e in episodes)


def _index(truth: Truth, t_s: float) -> int:
    """Return the newest sample of the truth at a time."""
    return max(int(np.searchsorted(truth.t_s, t_s, side="right")) - 1, 0)


def _quiet(truth: Truth, episodes: list[Episode]) -> NDArray[np.bool_]:
    """Return when "slipping" would be false: in contact, and far from every gross slip."""
    quiet = truth.normal_n > 0.0
    for e in episodes:
        quiet &= (truth.t_s < e.begin_s - EARLY_S) | (truth.t_s > e.end_s + LATE_S)
    return quiet


def _safe(truth: Truth, episodes: list[Episode]) -> NDArray[np.bool_]:
    """Return when a new alarm would be false."""
    last_used_s = np.maximum.accumulate(np.where(truth.utilisation < SAFE, -math.inf, truth.t_s))
    return _quiet(truth, episodes) & (truth.t_s - last_used_s > SETTLED_S)


def _overlap(spans: list[Span], within: Episode, levels: tuple[int, ...]) -> float:
    """Return for how long one of the levels is reported within a time."""
    return sum(
        max(min(s.end_s, within.end_s) - max(s.begin_s, within.begin_s), 0.0) for s in spans if s.level in levels
    )


def _changes(spans: list[Span], from_s: float, to_s: float) -> int:
    """Return the changes of level within a time, without the first one in contact."""
    touching = next((s.begin_s for s in spans if s.level not in (NO_CONTACT, UNKNOWN)), math.inf)
    return sum(max(from_s, touching) < s.begin_s <= to_s for s in spans)


def _errors(truth: Truth, reports: Reports, episodes: list[Episode]) -> tuple[Array, Array]:
    """Return the relative errors of required friction, and of the grip force needed."""
    at = reports.acquired_s
    used, normal = truth.at(truth.utilisation, at), truth.at(truth.normal_n, at)
    known = (used >= LEAST_USED) & (used < 1.0) & (normal >= LEAST_GRIP_N) & (at <= truth.t_s[-1])
    for e in episodes:
        known &= (at < e.begin_s) | (at > e.end_s + LATE_S)
    errors = np.abs(reports.required[known] / (used[known] * truth.mu) - 1.0)
    grip = reports.needed_n[known] / truth.at(truth.needed_n, at[known]) - 1.0
    return errors[np.isfinite(errors)], grip[np.isfinite(grip)]
