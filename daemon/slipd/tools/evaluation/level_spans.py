"""The levels that a run reported over time, from its messages."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from slipd_client.messages import GRASP_TOPIC, slip_topic

if TYPE_CHECKING:  # where all results are kept, nothing that reads recordings is loaded
    from slipd.recording.reader import Gap

NOT_RECORDED = "not_recorded"
"""Reason of "unknown" from the begin of a gap to the first message after it."""

_SLIP = slip_topic("")


class LevelSpan(NamedTuple):
    """A time in which one source reported one level for the same reasons.

    Attributes:
        level: The level.
        reasons: Its reasons, the most important first.
        evidence: Kinds of evidence of motion that any message of this time names, in order of appearance.
        begin_s: Time of the first such reading, s.
        end_s: Time of the first reading after it, s, or the end of the run.
    """

    level: str
    reasons: tuple[str, ...]
    evidence: tuple[str, ...]
    begin_s: float
    end_s: float

    @property
    def seconds(self) -> float:
        """Its length, s."""
        return self.end_s - self.begin_s

    def shifted(self, by_s: float) -> LevelSpan:
        """Return it some time later, s."""
        return self._replace(begin_s=self.begin_s + by_s, end_s=self.end_s + by_s)


def level_spans(
    messages: Iterable[tuple[str, dict[str, Any]]], end_s: float = 0.0, gaps: Sequence[Gap] = ()
) -> dict[str, list[LevelSpan]]:
    """Return what each source reported: every finger by its name, and "grasp" where both are judged together.

    Args:
        messages: Topic and body of every message of a run, in order. Only ``slip`` and ``grasp`` matter; both are
            published at once where the level changes, and where only the reasons do, at their rate.
        end_s: End of the run, s, where it lasts longer than to the last message.
        gaps: Times of which nothing is known, in order; one may be added until the first message after it is read.

    Returns:
        The spans of each source in order, each from the end of the one before. Before its first message a source has
        none; in a gap it is "unknown".
    """
    found: dict[str, list[LevelSpan]] = {}
    last_s, seen = end_s, 0
    for topic, body in messages:
        seen = _interrupt(found, gaps, seen)
        t_s = body["t_ns"] * 1e-9
        last_s = max(last_s, t_s)
        if topic == GRASP_TOPIC or topic.startswith(_SLIP):
            words = body["level"], tuple(body["reasons"]), tuple(body.get("evidence") or ())
            _append(found.setdefault(topic.removeprefix(_SLIP), []), *words, t_s)
    _interrupt(found, gaps, seen)
    return {source: [*spans[:-1], spans[-1]._replace(end_s=last_s)] for source, spans in found.items()}


def _interrupt(found: dict[str, list[LevelSpan]], gaps: Sequence[Gap], seen: int) -> int:
    """End every level at each gap after the first ``seen``; return the number of gaps."""
    for gap in gaps[seen:]:
        for spans in found.values():
            _append(spans, "unknown", (NOT_RECORDED,), (), gap.begin_s)
    return len(gaps)


def _append(
    spans: list[LevelSpan], level: str, reasons: tuple[str, ...], evidence: tuple[str, ...], t_s: float
) -> None:
    if spans:
        last = spans[-1]
        t_s = max(t_s, last.begin_s)  # a verdict on a stream that became stale has the time of its last reading
        spans[-1] = last._replace(end_s=t_s)
        if (last.level, last.reasons) == (level, reasons):
            named = tuple(dict.fromkeys(last.evidence + evidence))
            spans[-1] = last._replace(evidence=named, end_s=t_s)
            return
    spans.append(LevelSpan(level, reasons, evidence, t_s, t_s))
