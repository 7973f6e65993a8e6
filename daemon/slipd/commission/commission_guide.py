"""The steps that commission a rig, in their order. What they ask for and find goes through the host."""

from __future__ import annotations

from collections.abc import Sequence

from slipd.commission.config_update import FingerResult, changes
from slipd.commission.dialogue import Change, Say, Steps
from slipd.commission.readings import ReadingListener
from slipd.commission.touch_guide import TouchGuide
from slipd.commission.zero_step import take_zero
from slipd.config import Config


def commission(rig: Config, fingers: Sequence[str], patience_s: float) -> Steps[bool]:
    """Lead a person through all steps; return whether everything followed.

    Args:
        rig: The config that the daemon runs.
        fingers: Names of the fingers.
        patience_s: How long to wait for each touch, s.

    Raises:
        Skipped: The person left the step out.
        SlipdError: The daemon is silent or runs another config, or nothing was touched.
    """
    results: dict[str, FingerResult] = {}
    complete = True
    guide = TouchGuide(rig, ReadingListener(rig.finger, rig.config_id), patience_s)
    for name in fingers:
        yield from take_zero(name, rig.finger[name])
        outcome = yield from guide.run(name)
        for note in outcome.findings.notes:
            yield Say(f"  {name}: {note}")
        for problem in outcome.findings.problems:
            yield Say(f"  {name}: not found: {problem}")
        complete = complete and not outcome.findings.problems
        results[name] = outcome.result
    found = changes(rig, results)
    if found:
        yield Change(found)
    else:
        yield Say("\nThe config needs no change." if complete else "\nNothing is changed.")
    return complete
