"""The engine sends exactly what the schema of the wire declares: every topic, and the reply to every op.

Every other test that plays the engine compares its messages and replies with the schema too (`Run.feed`).
"""

from __future__ import annotations

from typing import Any

import pytest
from engine_rig import Run
from grasp_table import grasp_table
from run_courses import bring_up, grip, play
from wire_check import body_faults, faults_of

from slipd.events import Publish
from slipd_client.messages.fields import fields_of
from slipd_client.messages.ops import OPS
from slipd_client.messages.topics import TOPICS

GRASP = f"""
{grasp_table()}
[reflex]
enabled = true
raise_n_per_s = 100.0
"""
BEFORE = {"tare", "lease.acquire", "gripper.activate", "gripper.close"}
"""Ops that `Run.bring_up` and `Run.grip` request; `Run.feed` compares their replies."""

REQUESTS: list[tuple[str, dict[str, Any]]] = [
    ("hello", {}),
    ("tare.get", {"finger": "left"}),
    ("gravity.set", {"finger": "left", "gravity_mps2": [0.0, 0.0, -9.8]}),
    ("friction.set", {"finger": "left", "mu_s": 0.4, "mu_d": 0.3}),
    ("object.set", {"name": "mug"}),
    ("grip.set", {"force_n": 5.5}),
    ("grip.adjust", {"delta_n": 0.1}),
    ("grip.hold", {}),
    ("gripper.stop", {}),
    ("fault.ack", {}),
    ("motion.check", {"acceleration_mps2": [0.0, 0.0, 1.0]}),
    ("record.start", {}),
    ("record.stop", {}),
    ("tare.undo", {"finger": "left"}),
    ("gripper.open", {"drop": True}),
    ("lease.renew", {}),
    ("status", {}),
    ("lease.release", {}),
]


@pytest.fixture
def run(rig: str) -> Run:
    """A run in which everything is published, and every op is carried out at least once."""
    run = play(rig + GRASP, [bring_up, grip(5.0)])
    run.image()
    run.skin(5.0)
    run.wrench(5.0, (2.4, 0.0))
    run.serve_gripper(50)
    run.feel(5.0)
    for op, fields in REQUESTS:
        reply = run.ask(op, **fields)
        assert reply["ok"], (op, reply)
        assert body_faults(fields_of(OPS[op].reply), reply["result"], op) == []
        run.feel(5.0)
    return run


def test_every_topic_and_every_reply_has_exactly_the_declared_keys_and_kinds(run: Run) -> None:
    messages = [output for _, output in run.out if isinstance(output, Publish)]
    assert {message.topic.partition(".")[0] for message in messages} == set(TOPICS)
    assert [fault for message in messages for fault in faults_of(message)] == []
    assert any(message.body.get("reflex") for message in messages), "also the map that is nil in most messages"
    assert {op for op, _ in REQUESTS} | BEFORE == set(OPS)


def lie(body: dict[str, Any], path: tuple[str, ...], value: Any) -> dict[str, Any]:
    """A copy of a body with another value somewhere; ... removes the key."""
    if len(path) == 1:
        changed = body | {path[0]: value}
        return {key: each for key, each in changed.items() if each is not ...}
    return body | {path[0]: lie(body[path[0]], path[1:], value)}


@pytest.mark.parametrize(
    ("path", "value", "fault"),
    [
        (("later",), 1, "status.later: not declared"),
        (("uptime_s",), ..., "status.uptime_s: missing"),
        (("version",), None, "status.version: nil"),
        (("late_s",), "0", "status.late_s: '0' is not a number"),
        (("gripper", "lease", "held"), 1, "status.gripper: {"),
        (("streams", "left.wrench", "later"), 1, "status.streams.left.wrench.later: not declared"),
        (("streams", "left.wrench", "samples"), None, "status.streams.left.wrench.samples: nil"),
        (("fingers", "left", "mu_by"), ..., "status.fingers.left.mu_by: missing"),
    ],
)
def test_the_comparison_sees_what_is_not_as_declared(run: Run, path: tuple[str, ...], value: Any, fault: str) -> None:
    body = run.published("status")[-1]
    found = faults_of(Publish("status", lie(body, path, value)))
    assert len(found) == 1
    assert found[0].startswith(fault)
