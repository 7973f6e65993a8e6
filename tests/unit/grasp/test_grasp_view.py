"""Two fingers as one grasp: what depends on a finger that is unknown is unknown."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
import pytest
from finger_bench import read_force, teach
from known_zeros import known_finger
from pad_wrenches import finger_load, pad_wrench
from project import DOCS

from slipd import config
from slipd.config import Config, Levels
from slipd.grasp.grasp_view import GraspView
from slipd.grasp.hold_state import HoldState
from slipd.publish.finger_messages import slip_body
from slipd.publish.grasp_publisher import grasp_body
from slipd.types.samples import TactileSample, WrenchSample
from slipd_client.messages import MESSAGE_LIMITS, decode, encode

MS = 1_000_000
T0 = 100_000_000_000
FULL = np.full((4, 4), 100)
POSITIONS = "[[0.0, 0.0, 0.0, 0.16], [0.04, 0.0, {0}0.02, 0.15], [0.08, 0.0, {0}0.04, 0.13]]"
GRASP = f"""
[grasp.pads.left]
positions = {POSITIONS.format("")}
quat_xyzw = [0.5, -0.5, 0.5, 0.5]
[grasp.pads.right]
positions = {POSITIONS.format("-")}
quat_xyzw = [-0.5, -0.5, -0.5, 0.5]
"""
WIDTH_M = 0.06
PROTOCOL = (DOCS / "protocol.md").read_text(encoding="utf-8")
# Fields that are known whatever is known of the fingers.
ALWAYS = {"fingers", "state", "state_t_ns", "level", "level_code", "reasons", "evidence", "width_m", "age_s"}

Parse = Callable[[str], Config]
Wrench = Callable[..., WrenchSample]
Image = Callable[..., TactileSample]


class Hand:
    """Two equal fingers and the view of both; ``press`` gives one of them a reading on a fresh image."""

    def __init__(self, rig: Config, wrench: Wrench, image: Image) -> None:
        self.fingers = {name: known_finger(name, finger, Levels()) for name, finger in rig.finger.items()}
        assert rig.grasp is not None
        self.view = GraspView(rig.grasp, self.fingers)
        self._wrench, self._image = wrench, image

    def press(self, name: str, *contact: Any, t_ns: int = T0, counts: np.ndarray | None = FULL, **more: Any) -> None:
        if counts is not None:
            self.fingers[name].update_image(self._image(t_ns, counts))
        read_force(self.fingers[name], self._wrench(t_ns, *contact, **more))

    def hold(self, t_ns: int = T0) -> None:
        """10 N of grip, 2.4 N of load along the pads' X in halves."""
        self.press("left", 10.0, (1.2, 0.0), t_ns=t_ns)
        self.press("right", 10.0, (1.2, 0.0), t_ns=t_ns)

    def body(self, t_ns: int = T0, width_m: float | None = WIDTH_M) -> dict[str, Any]:
        self.view.update(width_m)
        body = grasp_body(self.view, HoldState(), t_ns)
        assert decode(encode(body), MESSAGE_LIMITS) == body, "plain finite values"
        return body

    def nil(self, **more: Any) -> set[str]:
        return {name for name, value in self.body(**more).items() if value is None}


MakeHand = Callable[..., Hand]


@pytest.fixture
def make_hand(left: str, parse: Parse, wrench: Wrench, image: Image) -> MakeHand:
    """Return a hand; ``changes`` replace text in the config of the left finger, or of both."""

    def make(*changes: tuple[str, str], both: bool = False) -> Hand:
        changed = left
        for old, new in changes:
            assert old in changed
            changed = changed.replace(old, new)
        right = (changed if both else left).replace("left", "right")
        return Hand(parse(changed + right + GRASP), wrench, image)

    return make


@pytest.fixture
def hand(make_hand: MakeHand) -> Hand:
    """μ 0.5, contact from 0.5 N, safety 1.3, pads 4×4 at 4 mm."""
    return make_hand()


def fields() -> Iterable[str]:
    section = PROTOCOL.partition("### `grasp`")[2].partition("\n##")[0]
    return re.findall(r"`(\w+)`", " ".join(re.findall(r"^\| (`.*?) \|", section, re.MULTILINE)))


def test_protocol_document_lists_the_fields_of_grasp(hand: Hand) -> None:
    assert set(fields()) == set(hand.body())


def test_held_box_has_every_field(hand: Hand) -> None:
    hand.hold()
    body = hand.body(T0 + 2 * MS)
    assert hand.nil() == set()
    assert (body["level"], body["level_code"], body["reasons"]) == ("stable", 1, [])
    assert body["fingers"] == ["left", "right"]
    assert body["internal_n"] == pytest.approx(10.0)
    assert body["utilisation"] == pytest.approx(0.24, rel=1e-5)
    assert body["grip_needed_n"] == pytest.approx(1.3 * 2.4, rel=1e-5)
    assert body["external_force_n"] == pytest.approx([0.0, 0.0, 2.4], abs=1e-12)
    assert body["external_torque_nm"] == pytest.approx([0.0, 0.0, 0.0], abs=1e-12)
    assert body["load_share"] == {"left": 0.5, "right": 0.5}
    assert body["asymmetry"] == pytest.approx(0.0)
    assert body["width_m"] == WIDTH_M
    assert body["age_s"] == pytest.approx(0.002)


def test_pads_move_with_the_width(hand: Hand) -> None:
    """1 N along the gripper's X: its lever along Z is where the pads are at this width."""
    hand.press("left", 10.0, (0.0, -0.5))
    hand.press("right", 10.0, (0.0, 0.5))
    for width_m, lever_m in ((0.0, 0.16), (0.04, 0.15), (0.05, 0.145), (0.08, 0.13)):
        body = hand.body(width_m=width_m)
        assert body["external_force_n"] == pytest.approx([1.0, 0.0, 0.0])
        assert body["external_torque_nm"] == pytest.approx([0.0, lever_m, 0.0])


def test_wrenches_of_both_pads_add_up_to_the_external_wrench(hand: Hand) -> None:
    """On the pads as the demo's config places them: the left pad's X, Y and spin are Z, −X and −Y of its gripper."""
    grasp = config.load(config.shipped("demo.toml")).grasp
    assert grasp is not None
    load, normal_n, at = (2.5, 0.7, 0.03), 12.0, (0.002, -0.001)
    for name, centre in (("left", at), ("right", (at[0], -at[1]))):
        force, torque = pad_wrench(finger_load(load, right=name == "right"), normal_n, centre)
        read_force(hand.fingers[name], WrenchSample(T0, None, force, torque, ()))
    view = GraspView(grasp, hand.fingers)
    view.update(WIDTH_M)
    body = grasp_body(view, HoldState(), T0)
    assert body["external_force_n"] == pytest.approx([-0.7, 0.0, 2.5])
    where = np.array((-at[1], 0.0, at[0]))
    torque = np.cross(where, np.array((-0.7, 0.0, 2.5))) - np.array((0.0, 0.03, 0.0))
    assert body["external_torque_nm"] == pytest.approx(torque.tolist())


@pytest.mark.parametrize("width_m", [-0.001, 0.081])
def test_torque_is_nil_outside_the_configured_widths(hand: Hand, width_m: float) -> None:
    hand.hold()
    assert hand.nil(width_m=width_m) == {"external_torque_nm"}


@pytest.mark.parametrize("width_m", [None, math.nan])
def test_torque_alone_is_nil_without_a_width(hand: Hand, width_m: float | None) -> None:
    hand.hold()
    assert hand.nil(width_m=width_m) == {"external_torque_nm", "width_m"}


def test_axial_push_is_external_force_not_grip(hand: Hand) -> None:
    """3 N against the left pad, which looks along −Y: the world pushes the box along +Y."""
    hand.press("left", 13.0, (1.2, 0.0))
    hand.press("right", 10.0, (1.2, 0.0))
    body = hand.body()
    assert body["internal_n"] == pytest.approx(10.0)
    assert body["external_force_n"] == pytest.approx([0.0, 3.0, 2.4])
    assert body["asymmetry"] == pytest.approx(3.0 / 23.0)
    assert body["utilisation"] == pytest.approx(0.24, rel=1e-5), "of the right finger, which is pressed less"
    assert body["grip_needed_n"] == pytest.approx(1.3 * 2.4, rel=1e-5)


def test_grip_needed_is_that_of_the_finger_that_lacks_most(make_hand: MakeHand) -> None:
    hand = make_hand(("mu = 0.5", "mu = 0.25\ngrip_safety = 2.0"))
    hand.press("left", 13.0, (3.0, 0.0))
    hand.press("right", 10.0, (1.0, 0.0))
    body = hand.body()
    needs = slip_body(hand.fingers["left"], hand.fingers["left"].state)["grip_needed_n"]
    assert needs == pytest.approx(24.0, rel=1e-5)
    assert body["grip_needed_n"] == pytest.approx(24.0 - 3.0, rel=1e-5), "its pad has 3 N more than the grip"
    assert body["utilisation"] == pytest.approx(3.0 / (0.25 * 13.0), rel=1e-5)
    assert body["load_share"] == pytest.approx({"left": 0.75, "right": 0.25})
    assert body["level"] == "warning"
    state = hand.view.state
    assert (state.level, state.reasons) == ("warning", ("translation",))
    assert (state.internal_n, state.grip_needed_n) == (body["internal_n"], body["grip_needed_n"])


@pytest.mark.parametrize("name", ["left", "right"])
@pytest.mark.parametrize("what", ["stale", "overload", "not_finite", "never"])
def test_grasp_is_unknown_where_one_finger_is(hand: Hand, name: str, what: str) -> None:
    other = "right" if name == "left" else "left"
    hand.press(other, 10.0, (1.2, 0.0))
    if what == "stale":
        hand.press(name, 10.0, (1.2, 0.0))
        hand.fingers[name].disconnect(T0)
    elif what == "overload":
        hand.press(name, 10.0, (1.2, 0.0), status=("overload",))
    elif what == "not_finite":
        hand.press(name, math.nan)
    body = hand.body()
    unknown = {key for key, value in body.items() if value is None}
    assert unknown == (set(body) - ALWAYS) | ({"age_s"} if what == "never" else set())
    assert body["level"] == "unknown", "one finger that holds makes no grasp"
    assert body["reasons"] == ["stale" if what == "never" else what]


def test_finger_in_disagreement_is_unknown(make_hand: MakeHand) -> None:
    """Its numbers are known, but not which of its sensors is right."""
    hand = make_hand(("threshold = 0.05", "threshold = 0.05\ngain_error = 0.1"))
    for ms in range(0, 2000, 10):
        hand.press("left", 10.0, (1.2, 0.0), t_ns=T0 + ms * MS, counts=4 * FULL)
        hand.press("right", 10.0, (1.2, 0.0), t_ns=T0 + ms * MS)
    assert hand.fingers["left"].state.utilisation is not None
    body = hand.body(T0 + 1990 * MS)
    assert body["reasons"][0] == "disagreement"
    assert {key for key, value in body.items() if value is None} == set(body) - ALWAYS


def test_free_fingers_have_no_grip_and_are_known(hand: Hand) -> None:
    hand.press("left", 0.1, (0.02, 0.0))
    hand.press("right", -0.1)
    body = hand.body()
    assert (body["level"], body["internal_n"]) == ("no_contact", 0.0)
    assert body["external_force_n"] == pytest.approx([0.0, 0.2, 0.02])
    unknown = {key for key, value in body.items() if value is None}
    assert unknown == {"utilisation", "grip_needed_n", "load_share", "asymmetry"}


def test_one_finger_against_a_wall_is_no_grip(hand: Hand) -> None:
    hand.press("left", 10.0, (1.0, 0.0))
    hand.press("right", 0.0)
    body = hand.body()
    assert (body["internal_n"], body["asymmetry"], body["level"]) == (0.0, 1.0, "stable")
    assert body["load_share"] == {"left": 1.0, "right": 0.0}
    assert body["grip_needed_n"] is body["utilisation"] is None


def test_learned_friction_lowers_the_need_but_not_what_the_reflex_keeps(hand: Hand) -> None:
    hand.hold()
    for finger in hand.fingers.values():
        teach(finger, 0.6)
    hand.hold(T0 + 400 * MS)
    state = hand.view.update(WIDTH_M)
    assert state.grip_needed_n == pytest.approx(1.3 * 2.0, rel=1e-5)
    assert state.grip_kept_n == pytest.approx(1.3 * 2.4, rel=1e-5), "as with the stated μ of 0.5"


def test_the_reflex_keeps_all_that_it_added_where_friction_is_only_learned(make_hand: MakeHand) -> None:
    hand = make_hand(("mu = 0.5\n", ""))
    hand.hold()
    teach(hand.fingers["left"], 0.6, slips=True)
    hand.hold(T0 + 400 * MS)
    assert hand.fingers["left"].friction.state.source == "learned"
    state = hand.view.update(WIDTH_M)
    assert state.grip_needed_n is not None
    assert state.grip_kept_n is None


def test_grip_needed_is_nil_without_image_or_mu(make_hand: MakeHand) -> None:
    for hand, counts in ((make_hand(), None), (make_hand(("mu = 0.5\n", "")), FULL)):
        hand.press("left", 10.0, (1.2, 0.0), counts=counts)
        hand.press("right", 10.0, (1.2, 0.0))
        body = hand.body()
        assert body["level"] == "unknown"
        assert {key for key, value in body.items() if value is None} == {"grip_needed_n", "utilisation"}


def test_grip_needed_is_nil_where_no_grip_holds(hand: Hand) -> None:
    one = np.zeros((4, 4))
    one[1, 1] = 100
    hand.press("left", 10.0, (0.0, 0.0), 0.01, (-0.002, -0.002), counts=one)
    hand.press("right", 10.0, (1.2, 0.0))
    body = hand.body()
    assert body["level"] == "warning"
    assert body["utilisation"] is body["grip_needed_n"] is None
    assert body["internal_n"] == pytest.approx(10.0)


def test_level_and_reasons_are_those_of_the_worse_finger(hand: Hand) -> None:
    def level_and_reasons() -> tuple[str, list[str]]:
        body = hand.body()
        return body["level"], body["reasons"]

    hand.press("left", 10.0, (3.7, 0.0))
    assert level_and_reasons() == ("caution", ["translation"]), "more severe than an unknown finger"
    hand.press("right", 10.0)
    assert level_and_reasons() == ("caution", ["translation"])
    hand.press("right", 10.0, (0.0, 0.0), 0.028)
    assert level_and_reasons() == ("warning", ["rotation"]), "the finger at caution adds no reason"
    hand.press("left", 10.0, (4.6, 0.0))
    assert level_and_reasons() == ("warning", ["translation", "rotation"])


def test_reason_of_both_fingers_is_listed_once(hand: Hand) -> None:
    hand.press("left", 10.0, (4.6, 0.0))
    hand.press("right", 10.0, (4.6, 0.0))
    assert hand.body()["reasons"] == ["translation"]


def test_unknown_finger_weight_hides_the_load_but_not_the_grip(make_hand: MakeHand) -> None:
    hand = make_hand(("stuck_after = 0", "stuck_after = 0\nmass_kg = 0.05"))
    hand.hold()
    assert hand.nil() == {"external_force_n", "external_torque_nm"}
    force = hand.fingers["left"].force
    assert force is not None
    force.set_gravity((0.0, 0.0, 0.0), T0)
    hand.hold()
    assert hand.nil() == set()


def test_three_axis_pads_make_a_grasp(left: str, right: str, parse: Parse, wrench: Wrench, image: Image) -> None:
    hand = Hand(parse(left + right + GRASP), wrench, image)
    hand.press("left", 10.0, (1.2, 0.0))
    counts = np.tile(np.array((1000 + 300, 1000, 1000 + 2500)), (4, 1)).astype(float)
    hand.fingers["right"].update_image(TactileSample(T0, None, counts))
    body = hand.body()
    assert body["internal_n"] == pytest.approx(10.0)
    assert body["external_force_n"] == pytest.approx([0.0, 0.0, 2.4], abs=1e-9)
    assert body["utilisation"] == pytest.approx(0.24, rel=1e-4)


def test_age_is_that_of_the_older_reading(hand: Hand) -> None:
    hand.press("left", 10.0)
    hand.press("right", 10.0, t_ns=T0 + 4 * MS)
    assert hand.body(T0 + 5 * MS)["age_s"] == pytest.approx(0.005)


def test_the_reflex_lowers_only_to_what_the_stated_friction_needs(hand: Hand) -> None:
    """A load beyond the stated friction is carried: it is known to hold, but learned friction never loosens a grip."""
    left = hand.fingers["left"]
    for k in range(100):
        if k == 10:
            left.begin_tare(T0 + 10 * MS, 0.05, "test")
        hand.press("left", 0.0, (0.0, 0.0), t_ns=T0 + k * MS, counts=np.zeros((4, 4)))
    for k in range(100, 700):
        hand.press("left", 10.0, (min(0.02 * (k - 100), 6.0), 0.0), t_ns=T0 + k * MS, counts=FULL + k % 3)
    hand.press("right", 10.0, (2.0, 0.0), t_ns=T0 + 699 * MS)
    state = hand.view.update(WIDTH_M)
    friction = left.friction.state
    assert (friction.mu, friction.source) == (pytest.approx(0.6, rel=0.01), "learned")
    assert state.grip_needed_n == pytest.approx(1.3 * 10.0, rel=0.01)
    assert state.grip_kept_n == pytest.approx(1.3 * 10.0 * 0.6 / 0.5, rel=0.01)
