"""What a run takes over from the run before it: only what is of the same device and config, and recent."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import pytest
from engine_rig import BOOT, GRIPPER, LEFT, NO_IMAGE, RIGHT, WALL_NS, Run

from slipd import config
from slipd.engine.engine import Engine
from slipd.events import StateRestored

RIG = LEFT + RIGHT + GRIPPER
SECOND = 1_000_000_000
EARLIER = BOOT.replace("b", "a")


def held(force_n: float = 5.0) -> tuple[Run, dict[str, Any]]:
    """A run that holds an object, and what it keeps, as by another boot."""
    run = Run(RIG)
    run.up()
    run.bring_up()
    run.ask("tare", finger="right", seconds=0.05)
    for _ in range(12):
        run.skin(0.0)
    run.grip(force_n)
    run.serve_gripper(50)
    return run, json.loads(run.engine.state_text) | {"boot": EARLIER}


def restarted(before: Run, state: dict[str, Any] | str | None, text: str = RIG, after_s: float = 1.0) -> Run:
    """A new run beside the same devices, which goes on to feel 5 N."""
    run = Run(text)
    run.gripper, run.t_ns = before.gripper, before.t_ns + round(after_s * SECOND)
    if state is not None:
        run.feed(StateRestored(state if isinstance(state, str) else json.dumps(state)))
    run.up()
    for _ in range(5):
        run.feel(5.0)
    run.serve_gripper(200)
    run.feel(5.0)
    return run


def zeros(run: Run) -> dict[str, tuple[int, str | None]]:
    streams = run.ask("status")["result"]["streams"]
    return {name: (each["tare_id"], each["tare_origin"]) for name, each in streams.items() if "tare_id" in each}


def test_a_restart_in_a_grasp_goes_on_with_the_zeros_and_the_grip_in_force() -> None:
    before, state = held()
    run = restarted(before, state)
    assert zeros(run) == {"left.wrench": (1, "stored"), "left.pad": (0, None), "right.pad": (1, "stored")}
    assert (run.level("left"), run.level("right")) == (("stable", []), ("stable", []))
    body = run.published("slip.left")[-1]
    assert (body["tare_origin"], body["tare_age_s"]) == (
        "stored",
        pytest.approx((run.t_ns - before.t_ns) * 1e-9 + 0.4, abs=0.4),
    )
    taken = run.ask("tare.get", finger="left")["result"]
    assert (taken["by"], taken["readings"], taken["tare_origin"]) == ("ann", 10, "stored")
    run.lease()
    assert run.ask("grip.adjust", delta_n=1.0)["result"]["applied_n"] == pytest.approx(6.0)
    assert json.loads(run.engine.state_text)["grip"]["raised_n"] == pytest.approx(1.0)


Change = Callable[[dict[str, Any]], object]
DAMAGED: dict[str, Change] = {
    "device": lambda state: state["tares"]["left.wrench"].update(opened="opened another"),
    "config": lambda state: state["tares"]["left.wrench"].update(basis="0" * 12),
    "size": lambda state: state["tares"]["left.wrench"]["offset"].pop(),
    "gravity": lambda state: state["tares"]["left.wrench"].update(gravity_mps2=[0.0]),
    "age": lambda state: state["tares"]["left.wrench"].update(wall_ns=WALL_NS - 3600 * SECOND),
    "future": lambda state: state["tares"]["left.wrench"].update(wall_ns=WALL_NS + 3600 * SECOND),
}
UNREADABLE: dict[str, Change] = {
    "version": lambda state: state.update(version=2),
    "rig": lambda state: state.update(rig="0" * 12),
    "number": lambda state: state["tares"]["left.wrench"].update(offset=["1"] * 6),
    "key": lambda state: state.update(more=1),
}


@pytest.mark.parametrize("what", [*DAMAGED, *UNREADABLE, "truncated", "not a number"])
def test_a_tare_that_may_be_wrong_is_not_used_and_the_reason_is_reported(what: str) -> None:
    before, state = held()
    {**DAMAGED, **UNREADABLE}.get(what, lambda _: None)(state)
    text = json.dumps(state)
    run = restarted(before, text[:-9] if what == "truncated" else text.replace("[0.0", "[NaN", what == "not a number"))
    assert zeros(run)["left.wrench"] == (0, None)
    status = run.ask("status", id="why")["result"]
    reason = status["streams"]["left.wrench"]["message"] if what in DAMAGED else status["notices"]["state"]
    assert "is not used: " in reason
    assert zeros(run)["right.pad"] == ((1, "stored") if what in DAMAGED else (0, "config"))


def test_a_stored_tare_waits_for_its_device_and_gives_way_to_one_of_this_run() -> None:
    before, state = held()
    run = Run(RIG)
    run.t_ns = before.t_ns + SECOND
    run.feed(StateRestored(json.dumps(state)))
    assert set(json.loads(run.engine.state_text)["tares"]) == set(state["tares"]), "kept while no device answers"
    run.up()
    for _ in range(3):
        run.image(NO_IMAGE)
    run.wrench(0.0)
    assert zeros(run)["left.wrench"] == (1, "stored")
    assert run.refusal("tare", finger="left", seconds=0.01) is None
    for _ in range(20):
        run.wrench(0.0)
    assert zeros(run)["left.wrench"] == (2, "measured")


def test_a_recording_that_begins_during_a_run_begins_with_its_state() -> None:
    run, _ = held()
    assert run.refusal("record.start") is None
    [first, *_] = run.engine.first_events
    assert isinstance(first, StateRestored)
    again = Engine(config.parse(RIG, "rig.toml"), boot=BOOT, wall_minus_monotonic_ns=WALL_NS)
    again.handle(first, run.t_ns + 7200 * SECOND)
    assert json.loads(again.state_text) == json.loads(first.text), "a tare of this run has no limit of age"
