"""Two fingers as one grasp: what depends on a finger that is unknown is unknown."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from finger_bench import read_force, teach
from fixture_types import Image, Parse, Wrench
from known_zeros import known_finger
from nanoseconds import MS, T0
from pad_wrenches import finger_load, pad_wrench

from slipd import config
from slipd.config import Config, Levels
from slipd.grasp.grasp_fingers import place_fingers
from slipd.grasp.grasp_view import GraspView, HoldState
from slipd.grasp.object_estimate import NOTHING_HELD
from slipd.publish.finger_messages import slip_body
from slipd.publish.grasp_messages import grasp_body
from slipd.tools.shipped_files import shipped_config
from slipd.types.samples import TactileSample, WrenchSample
from slipd_client.messages import MESSAGE_LIMITS, decode, encode

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
# Fields that are known whatever is known of the fingers.
ALWAYS = {"fingers", "state", "state_t_ns", "level", "level_code", "reasons", "evidence", "object", "width_m", "age_s"}


class Hand:
    """Two equal fingers and the view of both; ``press`` gives one of them a reading on a fresh image."""

    def __init__(self, rig: Config, wrench: Wrench, image: Image) -> None:
        self.fingers = {name: known_finger(name, finger, Levels()) for name, finger in rig.finger.items()}
        self.view = GraspView(place_fingers(rig.grasp, self.fingers))
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
        body = grasp_body(self.view, HoldState(), NOTHING_HELD, t_ns)
        assert decode(encode(body), MESSAGE_LIMITS) == body, "plain finite values"
        return body


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


def nil(body: dict[str, Any]) -> set[str]:
    return {name for name, value in body.items() if value is None}


NEEDS_MU, LIGHT = ("mu = 0.5\n", ""), ("mu = 0.5", "mu = 0.25\ngrip_safety = 2.0")
ONE_TAXEL = np.where(np.arange(16).reshape(4, 4) == 5, 100, 0)
NO_NEED = {"grip_needed_n", "utilisation"}
Press = tuple[tuple[Any, ...], dict[str, Any]]
GRASPS: dict[str, tuple[list[tuple[str, str]], Press, Press, set[str], dict[str, Any]]] = {
    "a held box": (
        [], ((10.0, (1.2, 0.0)), {}), ((10.0, (1.2, 0.0)), {}), set(),
        {"level": "stable", "level_code": 1, "internal_n": 10.0, "utilisation": 0.24, "grip_needed_n": 1.3 * 2.4,
         "external_force_n": [0.0, 0.0, 2.4], "external_torque_nm": [0.0, 0.0, 0.0], "asymmetry": 0.0,
         "load_share": {"left": 0.5, "right": 0.5}, "width_m": WIDTH_M, "age_s": 0.0, "fingers": ["left", "right"]},
    ),
    "an axial push: 3 N against the left pad, which looks along -Y, is external and no grip": (
        [], ((13.0, (1.2, 0.0)), {}), ((10.0, (1.2, 0.0)), {}), set(),
        {"internal_n": 10.0, "external_force_n": [0.0, 3.0, 2.4], "asymmetry": 3.0 / 23.0, "utilisation": 0.24,
         "grip_needed_n": 1.3 * 2.4},
    ),
    "the finger that lacks most decides; its pad has 3 N more than the grip": (
        [LIGHT], ((13.0, (3.0, 0.0)), {}), ((10.0, (1.0, 0.0)), {}), set(),
        {"grip_needed_n": 24.0 - 3.0, "utilisation": 3.0 / (0.25 * 13.0), "load_share": {"left": 0.75, "right": 0.25},
         "level": "warning", "reasons": ["translation"]},
    ),
    "free fingers": (
        [], ((0.1, (0.02, 0.0)), {}), ((-0.1,), {}), {*NO_NEED, "load_share", "asymmetry"},
        {"level": "no_contact", "internal_n": 0.0, "external_force_n": [0.0, 0.2, 0.02]},
    ),
    "one finger against a wall": (
        [], ((10.0, (1.0, 0.0)), {}), ((0.0,), {}), NO_NEED,
        {"internal_n": 0.0, "asymmetry": 1.0, "level": "stable", "load_share": {"left": 1.0, "right": 0.0}},
    ),
    "a finger without an image": (
        [], ((10.0, (1.2, 0.0)), {"counts": None}), ((10.0, (1.2, 0.0)), {}), NO_NEED, {"level": "unknown"}),
    "a finger without friction": (
        [NEEDS_MU], ((10.0, (1.2, 0.0)), {}), ((10.0, (1.2, 0.0)), {}), NO_NEED, {"level": "unknown"}),
    "a load that no grip holds": (
        [], ((10.0, (0.0, 0.0), 0.01, (-0.002, -0.002)), {"counts": ONE_TAXEL}), ((10.0, (1.2, 0.0)), {}), NO_NEED,
        {"level": "warning", "internal_n": 10.0},
    ),
    "a reason of both fingers": (
        [], ((10.0, (4.6, 0.0)), {}), ((10.0, (4.6, 0.0)), {}), set(),
        {"level": "warning", "reasons": ["translation"]},
    ),
    "caution is more severe than nothing to say": (
        [], ((10.0, (3.7, 0.0)), {}), ((10.0,), {}), set(),
        {"level": "caution", "reasons": ["translation"]},
    ),
    "the finger at caution adds no reason": (
        [], ((10.0, (3.7, 0.0)), {}), ((10.0, (0.0, 0.0), 0.028), {}), set(),
        {"level": "warning", "reasons": ["rotation"]},
    ),
    "both fingers at one level": (
        [], ((10.0, (4.6, 0.0)), {}), ((10.0, (0.0, 0.0), 0.028), {}), set(), {"reasons": ["translation", "rotation"]}),
}  # fmt: skip


@pytest.mark.parametrize("name", GRASPS)
def test_a_grasp_is_what_both_fingers_make_of_it(make_hand: MakeHand, name: str) -> None:
    changes, left, right, unknown, expected = GRASPS[name]
    hand = make_hand(*changes)
    for side, (contact, more) in (("left", left), ("right", right)):
        hand.press(side, *contact, **more)
    body = hand.body()
    assert nil(body) == unknown
    words = {"level", "reasons", "fingers"}
    for key, value in expected.items():
        assert body[key] == (value if key in words else pytest.approx(value, rel=1e-5, abs=1e-9)), key
    for finger in hand.fingers.values():
        needed = slip_body(finger, finger.state)["grip_needed_n"]
        assert needed == finger.state.needed_normal_n(finger.config), "solved once for one state"


def test_pads_move_with_the_width(hand: Hand) -> None:
    """1 N along the gripper's X: its lever along Z is where the pads are at this width."""
    hand.press("left", 10.0, (0.0, -0.5))
    hand.press("right", 10.0, (0.0, 0.5), t_ns=T0 + 4 * MS)
    for width_m, lever_m in ((0.0, 0.16), (0.04, 0.15), (0.05, 0.145), (0.08, 0.13)):
        body = hand.body(T0 + 5 * MS, width_m)
        assert body["age_s"] == pytest.approx(0.005), "of the older reading"
        assert body["external_force_n"] == pytest.approx([1.0, 0.0, 0.0])
        assert body["external_torque_nm"] == pytest.approx([0.0, lever_m, 0.0])
    for width_m in (-0.001, 0.081, None, math.nan):
        known = width_m is not None and math.isfinite(width_m)
        assert nil(hand.body(width_m=width_m)) == {"external_torque_nm"} | (set() if known else {"width_m"})


def test_wrenches_of_both_pads_add_up_to_the_external_wrench(hand: Hand) -> None:
    """On the pads as the demo's config places them: the left pad's X, Y and spin are Z, −X and −Y of its gripper."""
    grasp = config.load(shipped_config("demo.toml")).grasp
    load, normal_n, at = (2.5, 0.7, 0.03), 12.0, (0.002, -0.001)
    for name, centre in (("left", at), ("right", (at[0], -at[1]))):
        force, torque = pad_wrench(finger_load(load, right=name == "right"), normal_n, centre)
        read_force(hand.fingers[name], WrenchSample(T0, None, force, torque, ()))
    view = GraspView(place_fingers(grasp, hand.fingers))
    view.update(WIDTH_M)
    body = grasp_body(view, HoldState(), NOTHING_HELD, T0)
    assert body["external_force_n"] == pytest.approx([-0.7, 0.0, 2.5])
    where = np.array((-at[1], 0.0, at[0]))
    torque = np.cross(where, np.array((-0.7, 0.0, 2.5))) - np.array((0.0, 0.03, 0.0))
    assert body["external_torque_nm"] == pytest.approx(torque.tolist())


@pytest.mark.parametrize("name", ["left", "right"])
@pytest.mark.parametrize(
    ("what", "contact", "more"),
    [
        ("stale", (10.0, (1.2, 0.0)), {}), ("overload", (10.0, (1.2, 0.0)), {"status": ("overload",)}),
        ("not_finite", (math.nan,), {}), ("never", (), {}),
    ],
)  # fmt: skip
def test_grasp_is_unknown_where_one_finger_is(
    hand: Hand, name: str, what: str, contact: tuple[Any, ...], more: dict[str, Any]
) -> None:
    hand.press("right" if name == "left" else "left", 10.0, (1.2, 0.0))
    if contact:
        hand.press(name, *contact, **more)
    if what == "stale":
        hand.fingers[name].disconnect(T0)
    body = hand.body()
    assert nil(body) == (set(body) - ALWAYS) | ({"age_s"} if what == "never" else set())
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
    assert nil(body) == set(body) - ALWAYS


@pytest.mark.parametrize(
    ("stated", "kept_n"),
    [("mu = 0.5\n", pytest.approx(1.3 * 2.4, rel=1e-5)), ("", None)],  # it keeps all that it added
)
def test_learned_friction_lowers_the_need_but_not_what_the_reflex_keeps(
    make_hand: MakeHand, stated: str, kept_n: Any
) -> None:
    hand = make_hand(("mu = 0.5\n", stated), both=True)
    hand.hold()
    for finger in hand.fingers.values():
        teach(finger, 0.6, slips=not stated)
    hand.hold(T0 + 400 * MS)
    state = hand.view.update(WIDTH_M)
    assert {finger.friction.state.source for finger in hand.fingers.values()} == {"learned"}
    assert state.grip_needed_n is not None
    assert not stated or state.grip_needed_n == pytest.approx(1.3 * 2.0, rel=1e-5)
    assert state.grip_kept_n == kept_n


def test_unknown_finger_weight_hides_the_load_but_not_the_grip(make_hand: MakeHand) -> None:
    hand = make_hand(("stuck_after = 0", "stuck_after = 0\nmass_kg = 0.05"))
    hand.hold()
    assert nil(hand.body()) == {"external_force_n", "external_torque_nm"}
    force = hand.fingers["left"].force
    force.set_gravity((0.0, 0.0, 0.0), T0)
    hand.hold()
    assert nil(hand.body()) == set()


def test_three_axis_pads_make_a_grasp(left: str, right: str, parse: Parse, wrench: Wrench, image: Image) -> None:
    hand = Hand(parse(left + right + GRASP), wrench, image)
    hand.press("left", 10.0, (1.2, 0.0))
    counts = np.tile(np.array((1000 + 300, 1000, 1000 + 2500)), (4, 1)).astype(float)
    hand.fingers["right"].update_image(TactileSample(T0, None, counts))
    body = hand.body()
    assert body["internal_n"] == pytest.approx(10.0)
    assert body["external_force_n"] == pytest.approx([0.0, 0.0, 2.4], abs=1e-9)
    assert body["utilisation"] == pytest.approx(0.24, rel=1e-4)


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
