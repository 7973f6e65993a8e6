"""No gripper moves without a rule that allows it, for random requests, readings and faults.

Requests, readings and faults in any order, through the engine and the bytes of three real grippers, beside the reflex.
What must hold is looked at where it counts: on the gripper's wire, against the jaws as they really are. The usual run
is short and the same every time; `pytest --hypothesis-profile=long tests/motions/test_every_motion.py` looks
longer.
"""

from __future__ import annotations

import math
from typing import Any, ClassVar

import pytest
from engine_rig import MOVES
from gripper_peers import PEERS, Peer
from hypothesis import Phase, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, rule, run_state_machine_as_test
from motions.cell import BUDGET_N, CEILING_N, PART_M, STEP_N, brought_up
from motions.wire_oracle import EPS_N, MOTIONS, WireOracle
from nanoseconds import MS

from slipd.gripper.grip_policy import GripState
from slipd_client.messages.ops import OPS, Op

FRESH_NS = 50 * MS
ANN = b"ann"
LONG = settings.get_current_profile_name() == "long"
PHASES = (Phase.explicit, Phase.reuse, Phase.generate, Phase.shrink)
SHORT_RUN = settings(stateful_step_count=40, derandomize=True, database=None, phases=PHASES[:-1])
LONG_RUN = settings(phases=PHASES)
pytestmark = pytest.mark.timeout(0 if LONG else 120)

FORCES = st.one_of(st.sampled_from((2.0, 3.0, 5.0, 6.0, 7.5, 12.0, 25.0, 25.1)), st.floats(0.0, 30.0))
WIDTHS = st.one_of(st.none(), st.sampled_from((-0.06, -0.02, -0.002, 0.0, 0.002, 0.02)), st.floats(-0.05, 0.05))
"""From the present width: of what is asked for most is near it, on either side."""
MOSTLY = st.sampled_from((True, True, True, False))
CLIENTS = st.sampled_from((ANN, ANN, ANN, ANN, ANN, b"ben"))
ODD = st.sampled_from((None, True, "left", [5.0], math.nan, math.inf, -1e308, 2**63, -1, 0, 5e-324, 0.5, 5.0))


def wishes(op: Op) -> st.SearchStrategy[dict[str, Any]]:
    """Return fields of a request, right and wrong ones."""
    needed = {name: ODD for name, field in op.fields.items() if field.required}
    return st.fixed_dictionaries(needed, optional={name: ODD for name in op.fields if name not in needed})


ANYTHING = st.one_of(
    *(st.tuples(st.just(name), wishes(op)) for name, op in OPS.items() if not name.startswith(("lease.", "record.")))
)
"""Any request but those of leases and recordings, with right and wrong fields."""


class Motions(WireOracle, RuleBasedStateMachine):
    """One gripper, the engine, two clients, and what must hold."""

    JAWS: ClassVar[type[Peer]]

    @initialize(held=st.booleans(), lease_end=st.sampled_from(("hold", "stop")))
    def begin(self, held: bool, lease_end: str) -> None:
        self.cell = brought_up(self.JAWS, 6.0 if held else 0.0, lease_end=lease_end)
        self.cell.on_sent, self.cell.on_act = self.look_at_wire, self.look_at_act
        self.granted = "gripper.close" if held else "gripper.activate"  # the last motion
        self.raised_n = 0.0

    # -- what happens

    @rule(ms=st.sampled_from((5, 20, 20, 60, 60, 250, 700)))
    def time_passes(self, ms: int) -> None:
        self.cell.serve_gripper(ms)

    @rule()
    def the_lease_is_left_to_end(self) -> None:
        self.cell.let_lease_be()

    @rule()
    def all_is_well_again(self) -> None:
        cell = self.cell
        cell.state, cell.pull, cell.mute = {"left": "good", "right": "good"}, 0.0, False
        cell.serve_gripper(100)
        self.ask("fault.ack", ANN)
        if not cell.jaws.active:
            self.ask("gripper.activate", ANN, drop=True)
            cell.serve_gripper(1500)

    @rule(client=CLIENTS, more_m=WIDTHS, drop=MOSTLY)
    def open(self, client: bytes, more_m: float | None, drop: bool) -> None:
        self.ask("gripper.open", client, width_m=self.width(more_m), drop=drop)

    @rule(client=CLIENTS, more_m=WIDTHS, force_n=FORCES)
    def close(self, client: bytes, more_m: float | None, force_n: float) -> None:
        self.ask("gripper.close", client, width_m=self.width(more_m), force_n=force_n)

    @rule(force_n=FORCES, part_m=st.sampled_from((PART_M, 0.03)))
    def grip(self, force_n: float, part_m: float) -> None:
        self.cell.jaws.put(part_m)
        self.ask("gripper.close", ANN, force_n=force_n)
        self.cell.serve_gripper(500)

    @rule(client=CLIENTS, force_n=FORCES)
    def set_force(self, client: bytes, force_n: float) -> None:
        self.ask("grip.set", client, force_n=force_n)

    @rule(delta_n=st.one_of(st.sampled_from((-2.0, -0.5, 0.5, 1.0, 2.0)), st.floats(-3.0, 3.0)))
    def adjust(self, delta_n: float) -> None:
        self.ask("grip.adjust", ANN, delta_n=delta_n)

    @rule(op=st.sampled_from(("grip.hold", "gripper.stop", "fault.ack", "fault.ack")))
    def hold_stop_or_acknowledge(self, op: str) -> None:
        self.ask(op, ANN)

    @rule(drop=MOSTLY)
    def activate(self, drop: bool) -> None:
        self.ask("gripper.activate", ANN, drop=drop)

    @rule(client=CLIENTS, wish=ANYTHING)
    def anything(self, client: bytes, wish: tuple[str, dict[str, Any]]) -> None:
        op, fields = wish
        self.ask(op, client, **fields)

    @rule(part_m=st.sampled_from((PART_M, PART_M, 0.03, 0.0)))
    def something_lies_between(self, part_m: float) -> None:
        self.cell.jaws.put(part_m)

    @rule(pull=st.sampled_from((0.0, 0.2, 0.44, 0.48, 0.6)))
    def something_pulls(self, pull: float) -> None:
        self.cell.pull = pull

    @rule(finger=st.sampled_from(("left", "right")), state=st.sampled_from(("good", "good", "overload", "silent")))
    def a_finger_is_well_or_not(self, finger: str, state: str) -> None:
        self.cell.state[finger] = state

    @rule(mute=st.booleans())
    def the_line_is_mute_or_not(self, mute: bool) -> None:
        self.cell.mute = mute

    @rule(what=st.sampled_from(("replug", "sleep", "stall", "restart")))
    def something_goes_wrong(self, what: str) -> None:
        if what == "stall":
            self.cell.stall(60)
            return
        if what == "restart":
            self.granted = ""
            self.raised_n = 0.0
        getattr(self.cell, what)()
        self.cell.serve_gripper(40)

    # -- what must hold

    def width(self, more_m: float | None) -> Any:
        return ... if more_m is None else max(self.cell.jaws.width_m + more_m, 0.0)

    def ask(self, op: str, client: bytes, **fields: Any) -> None:
        cell, before_motion = self.cell, self.granted
        cell.serve_gripper(5)
        if client == ANN:
            cell.lease()
        before, pressed_n = cell.policy.state(cell.t_ns), min(cell.shown_n, cell.jaws.grip_n)
        self.granted = op if op in MOTIONS else self.granted  # what it has sent is seen before its reply
        reply = cell.ask(op, client, **fields)
        if not reply["ok"]:
            self.granted = before_motion
            if reply["error"]["code"] == "activating":
                assert "gripper.activate" in (op, before_motion) or not cell.jaws.active
            return
        if op not in (*MOVES, "fault.ack"):
            return
        assert before.holder == client
        if op not in ("gripper.stop", "grip.hold", "fault.ack"):
            assert not before.fault
        if op in ("gripper.open", "gripper.activate"):
            assert fields.get("drop") or not pressed_n, f"{op} drops what is pressed with {pressed_n} N"
        if op in ("gripper.close", "grip.set", "grip.adjust"):
            self.look_at_force(op, reply["result"]["applied_n"], before, pressed_n)

    def look_at_force(self, op: str, applied_n: float, before: GripState, pressed_n: float) -> None:
        """A request changed or began the force in force."""
        assert op == "gripper.close" or before.force_n is not None, "only a close begins a grip"
        assert not before.unknown or applied_n <= self.cell.jaws.forces_n[0] + EPS_N
        assert not pressed_n or applied_n <= max(pressed_n, before.force_n or 0.0) + STEP_N + EPS_N, (
            f"{op} takes what is pressed with {pressed_n} N to {applied_n} N at once"
        )
        if before.force_n is None:
            self.raised_n = 0.0
            return
        assert abs(applied_n - before.force_n) <= STEP_N + EPS_N
        self.look_at_raise(applied_n - before.force_n)

    def look_at_act(self, body: dict[str, Any]) -> None:
        """The reflex acted."""
        assert body["force_command_n"] <= body["reflex"]["force_n"] + EPS_N
        assert body["reflex"]["force_n"] <= CEILING_N + EPS_N
        self.look_at_raise(body["force_command_n"] - body["reflex"]["from_n"])

    def look_at_raise(self, change_n: float) -> None:
        if change_n <= EPS_N:
            return
        self.raised_n += change_n
        assert self.raised_n <= BUDGET_N + EPS_N, "all raises of one grasp have one budget"
        for finger, (felt_ns, good) in self.cell.felt.items():
            assert good, f"raised although {finger} is doubtful"
            assert self.cell.t_ns - felt_ns <= FRESH_NS, f"raised although {finger} is stale"


EXAMPLES = {"robotiq_2f": 10, "wsg": 4, "external_gripper": 4}
"""Of the usual run; the rules are the same for every gripper."""


@pytest.mark.parametrize("name", PEERS)
def test_no_motion_breaks_a_rule(name: str) -> None:
    machine = type(f"MotionsOf{PEERS[name].__name__}", (Motions,), {"JAWS": PEERS[name]})
    usual = settings(SHORT_RUN, max_examples=EXAMPLES[name])
    run_state_machine_as_test(machine, settings=LONG_RUN if LONG else usual)
