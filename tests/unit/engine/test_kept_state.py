"""What a run takes over from the run before it: only what is of the same device and config, and recent."""

from __future__ import annotations

import copy
import functools
import json
import random
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from engine_rig import BOOT, GRIPPER, LEFT, RIGHT, WALL_NS, Run
from run_courses import (
    Step,
    ask,
    bring_up,
    feel,
    follow,
    grip,
    lease,
    level,
    no_image,
    serve,
    skin,
    status,
    up,
    wait,
    wrench,
)

from slipd import config
from slipd.engine.engine import Engine
from slipd.events import LinkUp, StateRestored
from slipd.grasp.stored_state import seal

RIG = LEFT + RIGHT + GRIPPER
SECOND = 1_000_000_000
EARLIER = BOOT.replace("b", "a")


def kept(run: Run) -> dict[str, Any]:
    """What a run keeps for the next one."""
    return json.loads(run.engine.kept.text(run.t_ns).partition(" ")[2])


def held() -> tuple[Run, dict[str, Any]]:
    """A run that holds an object, and what it keeps, as by another boot."""
    run = copy.deepcopy(holding())
    return run, kept(run) | {"boot": EARLIER}


@functools.cache
def holding() -> Run:
    """What all tests begin with is run once."""
    run = Run(RIG, zeros=False)
    run.up()
    quiet = [serve(10), feel(0.0)] * 30  # the tared force sensor measures nothing, and the pad before it shows nothing
    tare = [ask("tare", finger="right", seconds=0.05), skin(0.0, times=12)]
    follow(run, [bring_up, *quiet, *tare, grip(5.0), serve(50)])
    return run


def begun(before: Run, state: dict[str, Any] | str) -> Run:
    """A new run beside the same devices, whose links are not open yet."""
    run = Run(RIG, zeros=False)
    run.gripper, run.t_ns = before.gripper, before.t_ns + SECOND
    run.feed(StateRestored(state if isinstance(state, str) else seal(json.dumps(state))))
    return run


def restarted(before: Run, state: dict[str, Any] | str) -> Run:
    """A new run beside the same devices, which goes on to feel 5 N."""
    run = begun(before, state)
    run.up()
    follow(run, [*[feel(5.0), serve(10)] * 20, feel(5.0)])
    return run


def zeros(run: Run) -> dict[str, tuple[int, str | None]]:
    streams = run.ask("status")["result"]["streams"]
    return {name: (each["tare_id"], each["tare_origin"]) for name, each in streams.items() if "tare_id" in each}


ADJUSTED = ask("grip.adjust", {"applied_n": pytest.approx(6.0)}, delta_n=1.0)


def zero(origin: str | None, number: int | None = None) -> Step:
    """Check where the zero of the left force sensor comes from."""
    found = {"tare_origin": origin, "tare_id": int(origin is not None) if number is None else number}
    return status(streams={"left.wrench": found})


def said(words: str) -> Step:
    """Check the message of the left force sensor."""

    def step(run: Run) -> None:
        assert words in run.ask("status")["result"]["streams"]["left.wrench"]["message"]

    return step


def test_a_restart_in_a_grasp_goes_on_with_the_zeros_and_the_grip_in_force() -> None:
    before, state = held()
    run = restarted(before, state)
    assert zeros(run) == {"left.wrench": (1, "stored"), "left.pad": (0, "stored"), "right.pad": (1, "stored")}
    assert (run.level("left"), run.level("right")) == (("stable", []), ("stable", []))
    body = run.published("slip.left")[-1]
    assert (body["tare_origin"], body["tare_age_s"]) == (
        "stored",
        pytest.approx((run.t_ns - before.t_ns) * 1e-9 + 0.4, abs=0.4),
    )
    taken = run.ask("tare.get", finger="left")["result"]
    assert (taken["by"], taken["readings"], taken["tare_origin"]) == ("ann", 10, "stored")
    follow(run, [lease, ADJUSTED])
    assert kept(run)["grip"]["raised_n"] == pytest.approx(1.0)


@pytest.mark.parametrize("unplugged", [False, True])
def test_a_kill_while_the_gripper_is_silent_keeps_the_grip(unplugged: bool) -> None:
    before, state = held()
    before.gripper.silent = True
    before.serve_gripper(2000)
    if unplugged:
        before.down("gripper")
    assert before.published("gripper")[-1]["object"] is None
    assert kept(before)["grip"] == state["grip"]
    before.gripper.silent = False
    run = restarted(before, kept(before) | {"boot": EARLIER})
    follow(run, [lease, ADJUSTED])


def test_F6_a_stored_zero_that_a_clear_pull_contradicts_is_not_used() -> None:
    before, state = held()
    pulled = [feel(-4.0)] * 30
    refused = [zero(None), said("the stored zero does not fit: the normal force is clearly negative")]
    follow(
        restarted(before, state),
        [zero("stored"), *pulled, *refused, *[feel(5.0)] * 30, level("unknown", "not_tared")],
    )


def test_a_state_that_cannot_be_read_is_reported_and_nothing_of_it_is_used() -> None:
    run = Run(RIG, zeros=False)
    run.feed(StateRestored("", "state.json: Permission denied"))
    notice = "the state of the run before is not used: state.json: Permission denied"
    follow(run, [up(), status(notices={"state": notice})])


def test_a_stored_zero_waits_for_its_device_and_replaces_none_that_was_measured_meanwhile() -> None:
    before, state = held()
    late = [wait(3700_000), up(), feel(5.0), zero(None), said("the device answers too late for restart.gap_s")]
    follow(begun(before, state), late)
    measured, _ = held()
    measured.feed(StateRestored(seal(json.dumps(state))))
    follow(measured, [feel(5.0), zero("measured")])
    state["tares"]["left.wrench"]["device"] = "S/N 7"
    follow(restarted(before, state), [zero(None)])  # this device never reports one


@pytest.mark.parametrize(
    "change", [{"found": 3}, {"stage": 0, "outputs": (0, 0, 0)}, {}], ids=["no object", "inactive", "width"]
)
def test_a_grip_that_the_gripper_does_not_confirm_is_forgotten(change: dict[str, Any]) -> None:
    before, state = held()
    for name, value in change.items():
        setattr(before.gripper, name, value)
    state["grip"]["width_m"] += 0.0 if change else 0.01
    state["grip"]["force_n"] = 7.0
    run = restarted(before, state)
    assert run.published("gripper")[-1]["force_command_n"] != 7.0
    grip = kept(run)["grip"]
    assert grip is None or grip["force_n"] != 7.0


def slip(run: Run) -> None:
    """Let the object slip on the left finger, at less than half of the load that the stated friction carries."""
    for k in range(620):
        run.wrench(5.0, (0.6 + 0.001 * k if k < 580 else 0.9, 0.0))
        if k % 20 == 0:
            run.image(np.full((4, 4), 100 + k % 7))
            run.skin(5.0, ms=1.0)
            run.serve_gripper(5)


def friction(run: Run) -> tuple[str | None, float, float]:
    """Name of the object, and the coefficient of static friction in use on each finger."""
    status = run.ask("status")["result"]
    return status["object_name"], status["fingers"]["left"]["mu"], status["fingers"]["right"]["mu"]


def slipped(name: str | None = "mug") -> tuple[Run, dict[str, Any], float]:
    """A run that learned the friction of a named object by a slip, what it keeps, and the coefficient."""
    run = copy.deepcopy(slipping(name))
    found, mu, right = friction(run)
    assert (found, mu, right) == (name, pytest.approx(0.21, abs=0.01), 0.5)
    return run, kept(run) | {"boot": EARLIER}, mu


@functools.cache
def slipping(name: str | None) -> Run:
    run, _ = held()
    if name is not None:
        run.ask("object.set", name=name)
    slip(run)
    return run


@pytest.mark.parametrize("name", ["mug", None])
def test_A10_what_a_slip_taught_and_the_name_go_on_with_the_grip(name: str | None) -> None:
    before, state, mu = slipped(name)
    run = restarted(before, state)
    assert friction(run) == (name, mu, 0.5)
    assert (run.level("left"), run.published("slip.left")[-1]["mu_source"]) == (("stable", []), "learned")
    status = run.ask("status")["result"]
    assert (status["object_by"], status["object_t_ns"]) == (None, None), "no client of this run named it"
    again = restarted(run, kept(run) | {"boot": EARLIER})
    assert friction(again) == (name, mu, 0.5), "nor does a second kill lose it"
    follow(again, [feel(0.0), serve(10)] * 5)
    assert (friction(again)[1] < 0.5) is (name is not None), "another grasp, of the same object where it has a name"


def test_what_a_slip_taught_waits_for_the_gripper() -> None:
    before, state, mu = slipped()
    run = begun(before, state)
    assert kept(run)["grip"] == state["grip"], "kept until the gripper answers"
    follow(run, [up(), feel(5.0)])
    assert friction(run) == (None, 0.5, 0.5)
    follow(run, [serve(10), feel(5.0)] * 5)
    assert friction(run) == ("mug", mu, 0.5)
    state["grip"]["width_m"] += 0.01
    assert friction(restarted(before, state)) == (None, 0.5, 0.5), "it is not confirmed"


def test_what_a_client_states_before_the_gripper_answers_counts_instead() -> None:
    before, state, _ = slipped()
    for op, fields, expected in (
        ("object.set", {"name": "box"}, ("box", 0.5, 0.5)),
        ("friction.set", {"finger": "left", "mu_s": 0.4}, ("mug", 0.4, 0.5)),
    ):
        run = begun(before, state)
        follow(run, [up(), lease, ask(op, **fields), serve(50)])
        assert kept(run)["grip"]["force_n"] == 5.0
        assert friction(run) == expected


@pytest.mark.parametrize(
    "slips", [[[-0.1, 0.01]], [[-1.5, 0.0]], [[-1.5, -1.0]], [[1e300, 0.01]], [[-1.5, 1e300]], [[-1.5, 5e-324]], []]
)
def test_friction_that_is_not_stricter_or_cannot_be_is_ignored(slips: list[list[float]]) -> None:
    before, state, _ = slipped()
    kept_of = state["grip"]["friction"]
    state["grip"]["friction"] = {"left": [[slips, None]] * 2, "another finger": kept_of["left"]}
    assert friction(restarted(before, state)) == ("mug", 0.5, 0.5)


def test_a_state_of_before_friction_was_kept_is_read() -> None:
    before, state, _ = slipped()
    del state["grip"]["friction"], state["grip"]["named"]
    run = restarted(before, state)
    assert friction(run) == (None, 0.5, 0.5)
    assert kept(run)["grip"]["force_n"] == 5.0


Change = Callable[[dict[str, Any]], object]
DAMAGED: dict[str, Change] = {
    "device": lambda state: state["tares"]["left.wrench"].update(opened="opened another"),
    "config": lambda state: state["tares"]["left.wrench"].update(basis="0" * 12),
    "size": lambda state: state["tares"]["left.wrench"]["offset"].pop(),
    "gravity": lambda state: state["tares"]["left.wrench"].update(gravity_mps2=[0.0]),
    "temperature": lambda state: state["tares"]["left.wrench"].update(temperature_c=14.9),
    "age": lambda state: state.update(kept_wall_ns=WALL_NS - 3600 * SECOND),
    "future": lambda state: state.update(kept_wall_ns=WALL_NS + 3600 * SECOND),
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
    body = json.dumps(state)
    text = seal(body.replace("[0.0", "[NaN", what == "not a number"))
    run = restarted(before, text[:-9] if what == "truncated" else text)
    assert zeros(run)["left.wrench"] == (0, None)
    status = run.ask("status", id="why")["result"]
    reason = status["streams"]["left.wrench"]["message"] if what in DAMAGED else status["notices"]["state"]
    assert "is not used: " in reason
    alone = what in DAMAGED and what not in ("age", "future")
    assert zeros(run)["right.pad"] == ((1, "stored") if alone else (0, "config")), "the others are used"


@pytest.mark.parametrize("temperature_c", [15.0, 35.0, None])
def test_a_tare_serves_at_about_the_temperature_of_its_sensor(temperature_c: float | None) -> None:
    before, state = held()
    assert state["tares"]["left.wrench"]["temperature_c"] == 25.0
    state["tares"]["left.wrench"]["temperature_c"] = temperature_c
    run = restarted(before, state)
    assert zeros(run)["left.wrench"] == (1, "stored")
    assert kept(run)["tares"]["left.wrench"]["temperature_c"] == temperature_c


def test_a_stored_tare_waits_for_its_device_and_gives_way_to_one_of_this_run() -> None:
    before, state = held()
    run = begun(before, state)
    assert set(kept(run)["tares"]) == set(state["tares"]), "kept while no device answers"
    again = [ask("tare", finger="left", seconds=0.01), wrench(0.0, times=20), zero("measured", 2)]
    follow(run, [up(), *[no_image] * 3, wrench(0.0), zero("stored"), *again])


def test_a_recording_that_begins_during_a_run_begins_with_its_state() -> None:
    run, _ = held()
    assert run.refusal("record.start") is None
    [first, *_] = run.engine.kept.first_events(run.t_ns)
    assert isinstance(first, StateRestored)
    again = Engine(config.parse(RIG, "rig.toml"), boot=BOOT, wall_minus_monotonic_ns=WALL_NS)
    again.handle(first, run.t_ns + 7200 * SECOND)
    again.handle(LinkUp("right.pad", "opened right.pad"), run.t_ns + 7200 * SECOND)
    assert again.kept.text(run.t_ns) == first.text, "a tare of this run has no limit of age"


FATES = ("whole", "none", "old", "later", "truncated", "flipped", "another device", "another config", "another rig")
"""What becomes of the state that a run kept."""
KINDS = {
    "scalar": LEFT,
    "charge": LEFT + "charge_tau_s = 2.0\n",
    "alone": LEFT.partition("[finger.left.pad]")[0],
    "config": LEFT + "tare = [" + ", ".join(["30"] * 16) + "]\n",
}


def levels(run: Run, finger: str) -> set[str]:
    return {body["level"] for body in run.published(f"slip.{finger}")}


def hold(run: Run, normal_n: float, bias_n: float, count: int) -> None:
    """Feed both fingers, whose sensors have offsets; a reading that repeats would be suspect."""
    for k in range(count):
        press = round(normal_n * 20) + k % 2
        if "left.pad" in run.engine.links:
            run.image(np.full((4, 4), 30 + (press if normal_n else 0)))
        run.skin(normal_n, ms=5.0)
        run.wrench(normal_n + bias_n, (0.1 * bias_n, 0.0), ms=5.0)


def damaged(fate: str, run: Run, rng: random.Random) -> tuple[str, str | None]:
    """Return the config and the text with which the next run begins, 60 s to an hour later."""
    text, state = run.engine.kept.text(run.t_ns), kept(run) | {"boot": EARLIER}
    config_text = run.engine.kept._config.text
    minutes = {"old": -61, "later": 70}.get(fate, 0)
    state["kept_wall_ns"] += minutes * 60 * SECOND
    text = seal(json.dumps(state))
    if fate == "truncated":
        text = text[: rng.randrange(len(text))]
    elif fate == "flipped":
        at = rng.randrange(len(text))
        text = text[:at] + chr(ord(text[at]) ^ 1 << rng.randrange(5)) + text[at + 1 :]
    elif fate == "another config":
        config_text = config_text.replace("rate_hz = 1000.0", "rate_hz = 900.0").replace(
            "pitch_m = 0.004", "pitch_m = 0.005"
        )
    elif fate == "another rig":
        config_text = config_text.replace("/dev/left-wrench", "/dev/left-sensor")
    return config_text, None if fate == "none" else text


def check_restart(seed: int) -> None:
    rng = random.Random(seed)
    kind, fate = rng.choice(list(KINDS)), rng.choice(FATES)
    normal_n, bias_n = rng.choice((0.0, rng.uniform(1.0, 20.0))), rng.uniform(-9.0, 30.0)
    before = Run(KINDS[kind] + RIGHT.partition("tare =")[0], zeros=False)
    before.up()
    hold(before, 0.0, bias_n, 5)
    assert levels(before, "left") | levels(before, "right") == {"unknown"}, "nobody tared yet"
    for finger in ("left", "right"):
        assert before.refusal("tare", finger=finger, stream="all", seconds=0.1, unloaded=True) is None
    hold(before, 0.0, bias_n, 40)
    assert before.level("left") == before.level("right") == ("no_contact", [])
    hold(before, normal_n, bias_n, 20)
    text, state = damaged(fate, before, rng)
    run = Run(text, zeros=False)
    run.t_ns = before.t_ns + rng.randrange(60, 3400) * SECOND
    if state is not None:
        run.feed(StateRestored(state))
    for name in run.engine.links:
        run.feed(LinkUp(name, f"{'another' if fate == 'another device' else 'opened'} {name}"))
    hold(run, normal_n, bias_n, 20)
    expected = {"stable"} if normal_n else {"no_contact"}
    for finger in ("left", "right"):
        if fate != "whole":
            assert levels(run, finger) == {"unknown"}, f"seed {seed}: {fate}, {kind}, {finger}, {normal_n:.1f} N"
        elif finger == "left" and kind in ("charge", "alone"):
            assert "stable" not in levels(run, finger), "without an image, or without the beginning of its contact"
        else:
            assert levels(run, finger) <= expected | {"unknown"}
            assert run.level(finger)[0] in expected, f"seed {seed}: {kind}, {finger}, {normal_n:.1f} N"


@pytest.mark.parametrize("first", range(0, 30, 10))
def test_F6_no_finger_is_believed_after_a_restart_unless_its_zero_is_known(first: int) -> None:
    for seed in range(first, first + 10):
        check_restart(seed)


@pytest.mark.long
@pytest.mark.timeout(900)
def test_F6_no_finger_is_believed_after_a_thousand_restarts_unless_its_zero_is_known() -> None:
    for seed in range(1000):
        check_restart(seed)
