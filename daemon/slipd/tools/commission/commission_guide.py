"""The steps that commission a rig, in their order; each can be left out, and the guide can begin with any.

What a step finds is written before the next one begins, and the next one waits until the daemon runs it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from slipd import config
from slipd.signals.gravity import STANDARD_GRAVITY_MPS2
from slipd.tools.commission.config_update import changes
from slipd.tools.commission.dialogue import (
    AGAIN,
    GO_ON,
    SKIP,
    Change,
    Gravity,
    Prompt,
    Reply,
    Say,
    Skipped,
    Steps,
    choose,
)
from slipd.tools.commission.friction_step import measure_friction
from slipd.tools.commission.gripper_steps import GENTLE_N, first_grasp, gentle_force, pulling_force, take_zero
from slipd.tools.commission.readings import ReadingListener, read_status, wait_for_restart
from slipd.tools.commission.touch_guide import TouchGuide
from slipd.tools.commission.touches import PUSH_X, PUSH_Y, Findings, Mount, Touch, mount_of
from slipd.tools.commission.weighing_search import WeightFindings
from slipd.tools.commission.weight_step import READY, weigh
from slipd_client.friction_session import low_estimate, spread

MOUNTING, WEIGHT, FRICTION, GRASP = STEPS = ("mounting", "weight", "friction", "grasp")

RESTART_PATIENCE = 5.0
"""How long the person may take to restart the daemon, in times of the patience for a touch."""

TIPS_DOWN_MPS2 = (STANDARD_GRAVITY_MPS2, 0.0, 0.0)

MOST_WEIGHINGS = 3
"""How often the pads are touched and weighed again where the two contradict each other."""

CONTRADICTED = "The weight and the mounting contradict each other. Touch the pads again, then weigh again."

MOST_ZEROS = 5
"""How often a zero that is needed is asked for again, each time with three tries, before the step is left out."""

LINKS_UP_S = 0.5
"""Readings of every finger for so long before a zero is taken: links come up one after the other."""

Values = dict[tuple[str, ...], str]


class Commission:
    """Leads through the steps.

    Args:
        rig: The config that the daemon runs.
        fingers: Names of the fingers.
        patience_s: How long to wait for each touch, s.
        restart: What the person does so that the daemon reads a changed config, for people.
        moves: It may move the gripper, each time after the person agreed.
    """

    def __init__(
        self,
        rig: config.Config,
        fingers: Sequence[str],
        patience_s: float,
        restart: str = "",
        *,
        moves: bool = True,
    ) -> None:
        self._rig, self._fingers, self._patience_s = rig, fingers, patience_s
        self._restart, self._moves = restart, moves
        self._mounts: dict[str, Mount] = {}
        self._unwritten = self._contradicted = False
        self._zeroed = False
        self._wrong_scale: dict[str, bool] = {}
        self._complete: dict[str, bool] = {}
        self._take_mounts()

    def run(self, first: str = MOUNTING) -> Steps[bool]:
        """Lead through the steps from one of them on; return whether everything followed.

        Raises:
            SlipdError: The daemon is silent or runs another config, or nothing was touched.
        """
        work: dict[str, Callable[[], Steps[bool]]] = {
            MOUNTING: self._find_mounting,
            WEIGHT: self._weigh,
            FRICTION: self._measure_friction,
            GRASP: self._grasp,
        }
        yield Gravity({})
        for step in STEPS[STEPS.index(first) :]:
            yield Say(f"\nStep {STEPS.index(step) + 1} of {len(STEPS)}: {step}")
            try:
                self._complete[step] = yield from work[step]()
            except Skipped:
                yield Say(f"  left out; later: slipd commission FILE --from {step}")
                self._complete[step] = False
        yield Gravity({})
        return all(self._complete.values())

    def _find_mounting(self) -> Steps[bool]:
        found = yield from self._touch(dict.fromkeys(self._fingers))
        without_image = [
            name
            for name, each in found.items()
            if self._rig.finger[name].pad is not None and each.mount is not None and each.symmetry is None
        ]
        if (yield from self._change_mounting(found)) and without_image:
            yield Say("\nNow the daemon can show the image of the pads: the presses are needed once more.")
            pushes = {name: {step: found[name].touches[step] for step in (PUSH_X, PUSH_Y)} for name in without_image}
            seconds = yield from self._touch(pushes)
            yield from self._change_mounting(seconds)
            found |= seconds
        return len(found) == len(self._fingers) and not any(each.problems for each in found.values())

    def _change_mounting(self, found: Mapping[str, Findings]) -> Steps[bool]:
        """Have what was found written, and keep the mountings; return whether the daemon runs them."""
        values = changes(self._rig, found)
        self._mounts |= {name: each.mount for name, each in found.items() if each.mount}
        return (yield from self._change(values))

    def _touch(self, pushes: Mapping[str, Mapping[str, Touch] | None]) -> Steps[dict[str, Findings]]:
        listener = ReadingListener(self._rig.finger, self._rig.config_id)
        guide = TouchGuide(self._rig, listener, self._patience_s)
        found: dict[str, Findings] = {}
        for name, known in pushes.items():
            try:
                yield from listener.check_config()
                yield from take_zero(name, self._rig.finger[name])
                found[name] = yield from guide.run(name, known)
            except Skipped:
                yield Say(f"  finger {name} is left out; later: slipd commission FILE --finger {name}")
            else:
                yield from _report(name, found[name].notes, found[name].problems)
        if not found:
            raise Skipped
        self._wrong_scale |= {name: each.wrong_scale for name, each in found.items()}
        self._zeroed = len(found) == len(self._fingers)
        return found

    def _weigh(self) -> Steps[bool]:
        names = [name for name in self._fingers if self._rig.finger[name].wrench is not None]
        if not names:
            yield Say("  no finger has a force sensor, so none has a weight to subtract")
            return True
        if why := self._blocked():
            yield Say(f"  left out: {why}")
            return False
        findings = yield from self._weigh_until_it_fits(names)
        found: Values = {}
        for name, each in findings.items():
            if each.found is not None:
                com_m = [round(float(part), 5) + 0.0 for part in each.found.com_m]
                found["finger", name, "wrench", "mass_kg"] = f"{each.found.mass_kg:.5f}"
                found["finger", name, "wrench", "com_m"] = str(com_m)
        yield from self._change(found)
        return not any(each.problems for each in findings.values())

    def _weigh_until_it_fits(self, names: Sequence[str]) -> Steps[dict[str, WeightFindings]]:
        """Weigh, and touch and weigh again where the weight contradicts the mounting and the person agrees."""
        tries = 0
        while True:
            findings = yield from weigh(self._rig, self._mounts, names)
            tries += 1
            for name, each in findings.items():
                yield from _report(name, each.notes, each.problems)
            self._contradicted = any(each.contradicts for each in findings.values())
            if not self._contradicted or tries == MOST_WEIGHINGS:
                return findings
            if (yield from choose(Prompt("mounting_again", CONTRADICTED, choices=(AGAIN, GO_ON, SKIP)))) != AGAIN:
                return findings
            self._complete[MOUNTING] = yield from self._find_mounting()

    def _measure_friction(self) -> Steps[bool]:
        if not (yield from self._ready()):
            return False
        needed_n = pulling_force(self._rig.finger[name] for name in self._fingers)
        force_n = gentle_force(self._rig.gripper, needed_n)
        yield from report_noise(needed_n, force_n)
        by_gripper = None if isinstance(force_n, str) or not self._moves else force_n
        results = yield from measure_friction(self._fingers, by_gripper, self._patience_s)
        found: Values = {}
        for name, group in results.items():
            found["finger", name, "mu"] = f"{low_estimate(group):.3f}"
            found["finger", name, "mu_spread"] = f"{spread(group):.3f}"
        yield from self._change(found)
        return len(results) == len(self._fingers)

    def _grasp(self) -> Steps[bool]:
        if not self._moves:
            yield Say("  left out: only slipd commission in a terminal moves the gripper, without --dry-run")
            return True
        force_n = gentle_force(self._rig.gripper)
        if isinstance(force_n, str):
            yield Say(f"  left out: {force_n}")
            return self._rig.gripper is None
        if not (yield from self._ready()):
            return False
        return (yield from first_grasp(self._fingers, force_n, self._patience_s))

    def _ready(self) -> Steps[bool]:
        """See that zero and weight of the fingers are known; return False if the step must be left out."""
        if why := self._blocked():
            yield Say(f"  left out: {why}")
            return False
        down = yield from self._down()
        if down:
            text = (
                "Turn the gripper so that the fingertips point straight down, with nothing between them; leave it so."
            )
            yield from choose(Prompt("tips_down", text, choices=(READY, SKIP)))
            yield Gravity(down)
        if down or not self._zeroed:
            yield from ReadingListener(self._rig.finger, self._rig.config_id).collect(LINKS_UP_S)
            for name in self._fingers:
                yield from self._take_needed_zero(name)
            self._zeroed = True
        return True

    def _take_needed_zero(self, name: str) -> Steps[None]:
        for _ in range(MOST_ZEROS):
            if (yield from take_zero(name, self._rig.finger[name])):
                return
            text = f"Without its zero, finger {name} shows other forces than act on it. See to the cause."
            if (yield from choose(Prompt("zero_again", text, name, (AGAIN, GO_ON, SKIP)))) == GO_ON:
                return
        yield Say(f"  given up: the zero was refused {MOST_ZEROS} times")
        raise Skipped

    def _blocked(self) -> str:
        """Return why a step that builds on what was found cannot be done; "" if it can."""
        if self._unwritten:
            return "what was found is not written, so the daemon does not run it"
        if wrong := [name for name, each in self._wrong_scale.items() if each]:
            return f"the forces of finger {', '.join(wrong)} are in another unit, see above"
        if self._contradicted:
            return "with a wrong mounting, its result would be wrong too; slipd commission FILE --from mounting"
        return ""

    def _down(self) -> Steps[dict[str, tuple[float, float, float]]]:
        """Return gravity with the fingertips down, of each finger whose weight the daemon cannot subtract yet."""
        streams = (yield from read_status()).streams
        states = {name: streams[f"{name}.wrench"].gravity for name in self._fingers if f"{name}.wrench" in streams}
        return {name: TIPS_DOWN_MPS2 for name, state in states.items() if state == "unknown_orientation"}

    def _change(self, found: Values) -> Steps[bool]:
        """Have values written, and wait until the daemon runs them; return whether it does."""
        if not found:
            yield Say("  nothing in the config changes")
            return False
        written = yield Change(found)
        if not isinstance(written, Reply) or written.result is None:
            self._unwritten = True
            return False
        before_id, self._rig = self._rig.config_id, config.parse(written.result, "new config")
        self._take_mounts()
        self._zeroed = False
        longest_s = RESTART_PATIENCE * self._patience_s
        yield from wait_for_restart(before_id, self._rig.config_id, self._restart, longest_s)
        return True

    def _take_mounts(self) -> None:
        sensors = {name: finger.wrench for name, finger in self._rig.finger.items()}
        self._mounts |= {name: mount_of(sensor) for name, sensor in sensors.items() if sensor is not None}


def report_noise(needed_n: float, force_n: float | str) -> Steps[None]:
    """Say which grip the noise of the force sensors asks for, where a gentle one does not show a slip."""
    if needed_n > GENTLE_N:
        yield Say(f"  the noise of the force sensors hides a slip at less than {needed_n:g} N on each pad")
    if not isinstance(force_n, str) and force_n < needed_n:
        yield Say(f"  max_force_n allows {force_n:g} N: a slip may not be seen; this step can be left out")


def _report(name: str, notes: Sequence[str], problems: Sequence[str]) -> Steps[None]:
    yield from (Say(f"  {name}: {note}") for note in notes)
    yield from (Say(f"  {name}: not found: {problem}") for problem in problems)
