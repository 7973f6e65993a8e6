"""The story of the demo in simulated time: what is reported against the truth."""

import copy

import numpy as np
import pytest
from demo_story import Story

from slipd import config
from slipd.engine.engine import Engine
from slipd.tools.sim.robot_program import ALARMING, Plan
from slipd.tools.sim.scene import Scene
from slipd.tools.sim.virtual_gripper import VirtualRig

READY_S, BEGIN_S, HELD_S = 2.0, 3.0, 6.9
MU_GIVEN_OVER_TRUE = 0.55 / 0.6


pytestmark = pytest.mark.xdist_group("story")
"""One process computes what all these tests share."""


@pytest.fixture(scope="module")
def held():
    """The story until the box is held: so far nothing was warned of."""
    engine = Engine(config.load(config.shipped("demo.toml")), boot="b", wall_minus_monotonic_ns=0)
    story = Story(VirtualRig(Scene(), seed=11), engine, BEGIN_S)
    story.grip(READY_S)
    story.until(HELD_S)
    assert not [body for _, body in story.changes if body["rising"] and body["level"] in ALARMING]
    return story


@pytest.fixture(scope="module")
def heeded(held):
    story = copy.deepcopy(held)
    story.until(Plan().open_s, heed=True)
    story.release(17.0)
    return story


@pytest.fixture(scope="module")
def unheeded(held):
    story = copy.deepcopy(held)
    story.until(9.8)
    return story


def test_the_shipped_demo_config_reads_every_stream_at_its_rate(heeded):
    status = heeded.ask("status")
    assert {name: s["message"] for name, s in status["streams"].items()} == dict.fromkeys(status["streams"], "")
    assert all(s["bad"] == s["lost"] == s["bad_bytes"] == 0 for s in status["streams"].values())


def test_the_reported_contact_is_the_true_contact(heeded):
    scene = heeded.rig.scene
    for finger, side in (("left", 1), ("right", -1)):
        seen = [
            (body, true)
            for t, body, true in heeded.verdicts
            if body["finger"] == finger and 4.6 < t < 12.9 and body["utilisation"] is not None
        ]
        assert len(seen) > 1000
        ratio = np.array([body["utilisation"] * MU_GIVEN_OVER_TRUE / true for body, true in seen])
        assert np.mean(ratio) == pytest.approx(1.0, abs=0.03)
        assert np.std(ratio) < 0.05
        centroid = np.mean([body["centroid_m"] for body, _ in seen], axis=0)
        assert centroid == pytest.approx((scene.patch.centre_m[0], side * scene.patch.centre_m[1]), abs=1e-4)
        assert np.mean([body["spin_nm"] for body, _ in seen]) * side > 0.01


def test_rotation_is_warned_of_well_before_it_would_begin(unheeded):
    warned, begins = unheeded.reported("warning", "rotation"), unheeded.truth("slide_begins")
    assert begins == pytest.approx(unheeded.rig.scene.rotation_would_begin_s, abs=0.03)
    assert 0.5 < begins - warned < 1.5
    assert unheeded.reported("caution", "rotation") < warned


def test_an_ignored_warning_stays_until_the_box_drops(unheeded):
    """The turn begins too slowly for the load to show it, and the contact stays where it is on the pads."""
    begins, dropped = unheeded.truth("slide_begins"), unheeded.truth("dropped")
    levels = [body["level"] for t, body in unheeded.changes if begins - 0.5 < t < dropped]
    assert set(levels) <= {"warning", "slipping"}
    assert unheeded.reported("warning", "rotation") < begins < dropped


def test_a_heeded_warning_saves_the_box(heeded):
    assert heeded.raises
    assert heeded.truth("dropped") is None
    assert heeded.truth("slide_begins") > 13.0
    assert heeded.rig.scene.width_m == heeded.rig.scene.open_width_m


def test_the_tug_is_reported_as_a_translation_and_its_slip_at_once(heeded):
    begins = heeded.truth("slide_begins")
    assert 13.0 < heeded.reported("warning", "translation") < begins
    assert begins <= heeded.reported("slipping", "slip_detected") < begins + 0.05


def test_nothing_is_reported_without_a_cause(heeded):
    alarms = [(t, body["level"]) for t, body in heeded.changes if t > 0 and body["level"] in ("caution", *ALARMING)]
    assert [alarm for alarm in alarms if not (7.0 < alarm[0] < 12.5 or 13.0 < alarm[0] < 14.9)] == []
    assert {body["level"] for t, body in heeded.changes if 2.1 < t < 16.0} <= {
        "stable",
        "caution",
        *ALARMING,
        "no_contact",
    }
