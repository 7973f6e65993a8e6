"""The scene of the demo in simulated time: bytes of the virtual gripper through the engine, and back."""

import copy
from dataclasses import dataclass, field

import numpy as np
import pytest
from wire_check import faults_of

from slipd import config
from slipd.engine.engine import Engine
from slipd.events import Bytes, LinkUp, Publish, Reply, Request, Tick, Write
from slipd.sim.robot_program import LEAST_RAISE_N, Plan
from slipd.sim.robot_report import ALARMING
from slipd.sim.scene import Scene
from slipd.sim.virtual_gripper import TICK_NS
from slipd.sim.virtual_rig import LINES, VirtualRig

READY_S, TARE_S, BEGIN_S, HELD_S = 2.0, 0.5, 3.0, 6.9
MU_GIVEN_OVER_TRUE = 0.55 / 0.6


@dataclass
class Story:
    """One run: the reports and the truth, times in s of the scene."""

    rig: VirtualRig
    engine: Engine
    changes: list = field(default_factory=list)
    verdicts: list = field(default_factory=list)
    raises: list = field(default_factory=list)

    def __post_init__(self):
        self.now_ns, self.asked, self.alarm = 0, 0, False
        self.force_n = self.wanted_n = self.raised_s = 0.0
        self.unread = dict.fromkeys(LINES, b"")
        self.newest = {}

    @property
    def t_s(self):
        return self.now_ns * 1e-9 - BEGIN_S

    def feed(self, event):
        reply = None
        for output in self.engine.handle(event, self.now_ns):
            assert faults_of(output, event if isinstance(event, Request) else None) == []
            if isinstance(output, Write):
                line = output.link.replace(".", "-")
                self.unread[line] += self.rig.receive(line, output.data, self.now_ns)
            elif isinstance(output, Reply):
                reply = output.body
            elif isinstance(output, Publish):
                self.hear(output.topic, output.body)
        return reply

    def hear(self, topic, body):
        if topic == "warning":
            self.changes.append((self.t_s, body))
            self.alarm |= body["rising"] and body["level"] in ALARMING and "rotation" in body["reasons"]
        elif topic.startswith("slip"):
            self.newest[topic] = body
            self.verdicts.append((self.t_s, body, self.rig.scene.utilisation))

    def ask(self, op, **fields):
        self.asked += 1
        envelope = {"v": 1, "id": self.asked, "op": op, "boot": "b", "deadline_ns": self.now_ns + 10**8}
        reply = self.feed(Request(b"operator", envelope | fields))
        assert reply["ok"], reply
        return reply["result"]

    def tick(self):
        self.now_ns += TICK_NS
        said = self.rig.advance(self.now_ns)
        for line in LINES:
            data, self.unread[line] = self.unread[line] + said[line], b""
            if data:
                self.feed(Bytes(line.replace("-", "."), data))
        if self.now_ns % (4 * TICK_NS) == 0:
            self.feed(Tick())

    def until(self, t_s, heed=False):
        while self.t_s < t_s:
            self.tick()
            if self.now_ns % (80 * TICK_NS) == 0 and self.t_s > 0:
                self.ask("lease.renew")
            if heed and self.alarm:
                self.wanted_n = max(body["grip_needed_n"] or 0.0 for body in self.newest.values())
            self.alarm = False
            plan = Plan()
            if self.wanted_n > self.force_n + LEAST_RAISE_N and self.t_s > self.raised_s + plan.step_s:
                asked_n = min(self.wanted_n, self.force_n + plan.step_n)
                self.force_n, self.raised_s = self.ask("grip.set", force_n=asked_n)["applied_n"], self.t_s
                self.raises.append((self.t_s, self.force_n))

    def reported(self, level, reason):
        """Return when a level was first reported for a reason."""
        return next((t for t, body in self.changes if body["level"] == level and reason in body["reasons"]), None)

    def truth(self, event):
        return next((truth.t_s for truth in self.rig.scene.truth if truth.event == event), None)


@pytest.fixture(scope="module")
def held():
    """The story until the box is held: so far nothing was warned of."""
    plan = Plan()
    rig = VirtualRig(Scene(), seed=11)
    engine = Engine(config.load(config.shipped("demo.toml")), boot="b", wall_minus_monotonic_ns=0)
    story = Story(rig, engine)
    for line in LINES:
        rig.opened(line, 0)
        story.feed(LinkUp(line.replace("-", "."), line))
    story.until(READY_S - BEGIN_S)
    for finger in ("left", "right"):
        story.ask("tare", finger=finger, seconds=TARE_S)
    story.until(0.0)
    story.ask("lease.acquire", ttl_ms=200)
    story.ask("gripper.activate")
    story.until(plan.close_s)
    story.force_n = story.ask("gripper.close", force_n=plan.force_n, speed_mps=plan.speed_mps)["applied_n"]
    story.until(HELD_S)
    assert not [body for _, body in story.changes if body["rising"] and body["level"] in ALARMING]
    return story


@pytest.fixture(scope="module")
def heeded(held):
    story = copy.deepcopy(held)
    story.until(Plan().open_s, heed=True)
    story.wanted_n = 0.0
    story.ask("gripper.open", drop=True)
    story.until(17.0)
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
