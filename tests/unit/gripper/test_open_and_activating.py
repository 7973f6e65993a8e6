"""`gripper.open` never closes the jaws, and no close is accepted during activation; through engine and device bytes."""

from __future__ import annotations

import pytest
from motions.cell import PART_M, brought_up
from motions.jaws import GRIPPERS, Jaws, Sent

pytestmark = pytest.mark.no_cover

EACH = pytest.mark.parametrize("jaws", GRIPPERS.values(), ids=GRIPPERS.keys())


@EACH
@pytest.mark.parametrize("drop", [True, False])
def test_an_open_to_a_narrower_width_is_refused_and_nothing_is_sent(jaws: type[Jaws], drop: bool) -> None:
    cell = brought_up(jaws)
    cell.jaws.put(PART_M)
    sent: list[Sent] = []
    cell.on_sent = sent.append
    for width_m in (0.0, PART_M, round(cell.jaws.width_m - 0.001, 4)):
        refused = cell.ask("gripper.open", width_m=width_m, drop=drop)["error"]
        assert (refused["code"], refused["field"]) == ("out_of_range", "width_m")
        assert refused["message"].startswith("gripper.open only widens: width_m must be at least the present ")
    cell.run(1500)
    assert {one.kind for one in sent} <= {"other"}
    assert cell.jaws.grip_n == 0.0


@EACH
def test_an_open_widens_from_where_the_fingers_are_and_goes_on_widening(jaws: type[Jaws]) -> None:
    cell = brought_up(jaws, 6.0)
    assert cell.code("gripper.open", width_m=PART_M + 0.02, drop=True) is None
    cell.run(60)
    assert cell.code("gripper.open", width_m=PART_M + 0.01, drop=True) == "out_of_range", "it may be there already"
    cell.run(1500)
    assert cell.jaws.width_m == pytest.approx(PART_M + 0.02, abs=2e-4)
    assert cell.code("gripper.open", width_m=cell.body["width_m"]) is None, "the present width, as it is published"
    assert cell.code("gripper.open") is None


@EACH
def test_fingers_that_feel_nothing_have_not_let_go_while_they_move(jaws: type[Jaws]) -> None:
    """A silent sensor shows no contact either: open and close in one breath is no way around step and feeling."""
    cell = brought_up(jaws, 6.0)
    cell.state = {"left": "silent", "right": "silent"}
    cell.run(100)
    assert cell.code("gripper.open", drop=True) is None
    cell.run(60)
    assert cell.body["moving"]
    assert cell.code("gripper.close", force_n=12.0) == "out_of_range"
    cell.run(1500)
    assert not cell.body["moving"]
    assert cell.code("gripper.close", force_n=12.0) is None, "another grasp"


@pytest.mark.parametrize("jaws", [GRIPPERS["robotiq_2f"], GRIPPERS["wsg"]])
def test_nothing_closes_while_the_gripper_is_still_activating(jaws: type[Jaws]) -> None:
    cell = brought_up(jaws)
    assert cell.code("gripper.close", force_n=6.0, width_m=0.01) is None
    cell.run(1500)
    assert cell.code("gripper.activate", drop=True) is None
    codes = set()
    while not cell.jaws.active or not codes:
        refused = cell.ask("gripper.close", force_n=6.0)["error"]
        assert refused["message"] == "the gripper is still activating"
        codes.add(refused["code"])
        cell.run(20)
    assert codes == {"activating"}
    assert {cell.code(op, drop=True) for op in ("gripper.open",)} <= {"activating", None}
    cell.run(1500)
    assert cell.code("gripper.close", force_n=6.0) is None


def test_a_close_is_refused_until_the_driver_has_answered_the_activation() -> None:
    cell = brought_up(GRIPPERS["external_gripper"])
    cell.jaws._driver.mute = True
    assert cell.code("gripper.activate", drop=True) is None
    assert cell.code("gripper.close", force_n=6.0) == "activating", "it is not sent yet"
    cell.run(50)
    assert cell.body["active"], "whatever the driver reports"
    assert cell.code("gripper.close", force_n=6.0) == "activating"
    cell.jaws._driver.mute = False
    cell.run(200)
    assert cell.code("gripper.close", force_n=6.0) is None


def test_a_stop_ends_an_activation() -> None:
    cell = brought_up(GRIPPERS["wsg"])
    assert cell.code("gripper.close", force_n=6.0, width_m=0.01) is None
    cell.run(1500)
    cell.jaws._gripper.words.discard("referenced")
    cell.run(60)
    assert cell.code("fault.ack") is None, "nobody asked for that"
    assert cell.code("gripper.activate", drop=True) is None
    cell.run(60)
    assert cell.code("gripper.close", force_n=6.0) == "activating"
    assert cell.code("gripper.stop") is None
    cell.run(60)
    cell.ask("fault.ack")
    assert cell.code("gripper.close", force_n=6.0) == "not_active"
