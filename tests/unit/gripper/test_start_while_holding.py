"""A daemon that starts while the gripper holds an object adopts that grip; through engine and device bytes."""

from __future__ import annotations

import pytest
from motions.cell import MOST_N, PART_M, STEP_N, Cell, brought_up
from motions.jaws import GRIPPERS, Jaws, RobotiqJaws, Sent

from slipd_client.messages.names import GRIP_UNKNOWN

pytestmark = pytest.mark.no_cover

EACH = pytest.mark.parametrize("jaws", GRIPPERS.values(), ids=GRIPPERS.keys())
HELD_N = 6.0


def found(jaws: type[Jaws], *, feels: bool = True) -> Cell:
    """A daemon that has just been started anew, beside a gripper that holds the part with 6 N."""
    cell = brought_up(jaws, HELD_N)
    if not feels:
        cell.state = {"left": "silent", "right": "silent"}
    cell.restart()
    cell.run(200)
    cell.lease()
    return cell


def forces(cell: Cell) -> list[float]:
    """Forces on the wire from here on."""
    sent_n: list[float] = []

    def note(sent: Sent) -> None:
        if sent.force_n is not None:
            sent_n.append(sent.force_n)

    cell.on_sent = note
    return sent_n


@EACH
def test_a_close_from_6_to_25_n_is_refused_as_the_step_that_it_is(jaws: type[Jaws]) -> None:
    cell = found(jaws)
    sent_n = forces(cell)
    refused = cell.ask("gripper.close", force_n=MOST_N)["error"]
    assert (refused["code"], refused["field"]) == ("out_of_range", "force_n")
    assert "may change by at most 2 N from the " in refused["message"]
    cell.run(100)
    assert sent_n == []
    assert cell.jaws.grip_n == pytest.approx(HELD_N)


@EACH
def test_it_is_held_and_changed_from_what_it_is(jaws: type[Jaws]) -> None:
    cell = found(jaws)
    assert cell.ask("grip.hold")["result"] == {"force_n": pytest.approx(HELD_N, abs=0.05)}
    assert cell.ask("grip.set", force_n=7.5)["ok"]
    assert cell.code("grip.adjust", delta_n=1.0) == "too_fast"
    cell.run(300)
    assert cell.jaws.grip_n == pytest.approx(7.5, abs=0.1)
    assert cell.ask("gripper.close", force_n=9.0)["ok"]
    cell.run(100)
    assert cell.jaws.grip_n == pytest.approx(9.0, abs=0.1)


@EACH
def test_all_raises_from_there_have_one_budget(jaws: type[Jaws]) -> None:
    cell = found(jaws)
    codes = []
    for _ in range(20):
        cell.run(250)
        codes.append(cell.code("grip.adjust", delta_n=STEP_N))
    assert codes[:5] == [None] * 5
    assert set(codes[6:]) <= {"budget_spent", "out_of_range"}
    assert HELD_N + 9.9 <= cell.jaws.grip_n <= HELD_N + 12.05


@EACH
def test_the_reflex_keeps_it(jaws: type[Jaws]) -> None:
    cell = found(jaws)
    cell.pull = 0.46
    cell.run(300)
    assert cell.acts
    assert cell.acts[0]["from_n"] == pytest.approx(HELD_N, abs=0.05)
    assert cell.jaws.grip_n > HELD_N


@EACH
def test_a_link_that_is_lost_is_latched(jaws: type[Jaws]) -> None:
    cell = found(jaws)
    cell.replug()
    cell.run(200)
    assert cell.body["latched_fault"] == "link_lost"
    cell.lease()
    assert cell.code("gripper.close", force_n=MOST_N) == "fault_latched"
    assert cell.code("fault.ack") is None
    assert cell.code("gripper.close", force_n=MOST_N) == "out_of_range"


@EACH
def test_what_is_held_is_not_relieved_by_a_width(jaws: type[Jaws]) -> None:
    """Where the grip was closed to is not known: the present width may be one at which nothing presses."""
    cell = found(jaws)
    assert cell.code("gripper.close", force_n=HELD_N, width_m=PART_M - 0.001) == "not_ready"
    assert cell.code("gripper.open") == "in_contact"
    assert cell.code("gripper.open", drop=True) is None
    cell.run(1500)
    assert cell.jaws.grip_n == 0.0
    cell.jaws.put(0.0)
    assert cell.code("gripper.close", force_n=12.0) is None, "another grasp"


@pytest.mark.parametrize("feels", [True, False])
def test_A10_a_grip_of_unknown_force_stays_as_it_is(feels: bool) -> None:
    """A Robotiq does not report its force; with both fingers silent, or not known to be right, nobody does."""
    cell = found(RobotiqJaws, feels=False)
    sent_n = forces(cell)
    for op, fields in (
        ("gripper.close", {"force_n": MOST_N}),
        ("gripper.close", {"force_n": RobotiqJaws.LEAST_N}),
        ("grip.set", {"force_n": HELD_N}),
        ("grip.adjust", {"delta_n": 1.0}),
    ):
        refused = cell.ask(op, **fields)["error"]
        assert refused["code"] == "not_ready"
        assert "put the object down" in refused["message"]
    assert cell.ask("grip.hold")["result"] == {"force_n": None}
    assert GRIP_UNKNOWN in cell.ask("status")["result"]["streams"]["gripper"]["message"]
    if feels:
        cell.state = {"left": "good", "right": "good"}
        cell.run(200)
        assert cell.ask("grip.hold")["result"] == {"force_n": pytest.approx(HELD_N, abs=0.05)}
        assert GRIP_UNKNOWN not in cell.ask("status")["result"]["streams"]["gripper"]["message"]
        return
    cell.run(100)
    assert sent_n == []
    assert cell.code("gripper.open", drop=True) is None
    cell.run(1500)
    cell.jaws.put(0.0)
    assert cell.code("gripper.close", force_n=12.0) is None, "another grasp"


def test_an_open_that_was_never_sent_leaves_the_force_unknown() -> None:
    cell = found(RobotiqJaws, feels=False)
    sent_n = forces(cell)
    cell.run(20)
    cell.mute = True
    cell.run(20)
    assert cell.code("gripper.open", drop=True) is None
    cell.stall(60)
    cell.mute = False
    cell.run(400)
    assert sent_n == []
    cell.ask("lease.acquire", ttl_ms=200)
    assert cell.ask("fault.ack")["result"] == {"fault": "command_lost"}
    assert cell.code("gripper.close", force_n=RobotiqJaws.LEAST_N) == "not_ready"


@pytest.mark.parametrize(("key", "limit_n", "wanted_n"), [("min_force_n", 9.0, 9.0), ("max_force_n", 3.5, 3.5)])
def test_A10_a_grip_far_outside_the_limits_is_not_changed_to_them_at_once(
    key: str, limit_n: float, wanted_n: float
) -> None:
    before = brought_up(RobotiqJaws, HELD_N)
    cell = Cell(before.jaws, before.now_ns, **{key: limit_n})
    cell.run(200)
    cell.lease()
    assert cell.ask("grip.hold")["result"] == {"force_n": pytest.approx(HELD_N, abs=0.05)}
    assert cell.code("grip.set", force_n=wanted_n) == "out_of_range"


@pytest.mark.parametrize("jaws", [GRIPPERS["wsg"], GRIPPERS["external_gripper"]])
def test_A10_a_kept_force_that_was_never_sent_is_not_believed(jaws: type[Jaws]) -> None:
    """The daemon was killed between a request and its command; the gripper reports the force that it has."""
    cell = brought_up(jaws, HELD_N)
    cell.mute = True
    assert cell.code("grip.set", force_n=HELD_N + STEP_N) is None
    kept, cell.mute = cell.kept(), False
    cell.restart(kept)
    cell.run(200)
    cell.lease()
    assert cell.ask("grip.hold")["result"] == {"force_n": pytest.approx(HELD_N, abs=0.05)}


@EACH
def test_free_fingers_begin_a_grip_with_any_force(jaws: type[Jaws]) -> None:
    cell = brought_up(jaws)
    cell.restart()
    cell.run(200)
    cell.lease()
    cell.jaws.put(PART_M)
    assert cell.code("gripper.close", force_n=12.0) is None


@EACH
def test_open_and_close_at_once_is_no_way_around_the_step(jaws: type[Jaws]) -> None:
    cell = brought_up(jaws, HELD_N)
    assert cell.code("gripper.open", drop=True) is None
    assert cell.code("gripper.close", force_n=MOST_N) == "out_of_range"
    assert cell.code("grip.set", force_n=HELD_N) == "not_ready", "nothing is gripped for whoever asks"
    cell.run(1500)
    assert cell.code("gripper.close", force_n=12.0) is None, "it has let go"
