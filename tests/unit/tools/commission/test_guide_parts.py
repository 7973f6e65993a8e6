"""The parts of the guide: the zero, choices, the gentle force, how the daemon is reached, and why it refuses."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from slipd import config
from slipd.errors import SlipdError
from slipd.tools.commission.commission_guide import report_noise
from slipd.tools.commission.daemon_link import TARES, link_to, reason_of
from slipd.tools.commission.dialogue import (
    Ask,
    Choice,
    Event,
    Output,
    Prompt,
    Refusal,
    Reply,
    Say,
    Skipped,
    Steps,
    choose,
    follow,
)
from slipd.tools.commission.gripper_steps import gentle_force, pulling_force
from slipd.tools.commission.readings import ReadingListener, pause, read_status
from slipd.tools.commission.weight_step import POSES, weigh
from slipd_client import keys
from slipd_client.errors import ClientError, NoAnswer, RequestRefused, TareGivenUp
from slipd_client.messages import TARE_REASONS
from slipd_client.messages.topics import Message

RIG = """
[finger.left.wrench]
device = "bota"
port = "/dev/wrench"
rate_hz = 100.0
"""
GRIPPER = """
[gripper]
device = "robotiq_2f"
port = "/dev/gripper"
rate_hz = 50.0
force_table = [[0, {least}], [255, 185.0]]
width_table = [[0.0, 0.085], [1.0, 0.0]]
"""


def host(printed: list[str], answer: Callable[[Ask], Event], events: list[Event]) -> Callable[[Output], Event]:
    def respond(output: Output) -> Event:
        if isinstance(output, (Say, Prompt)):
            printed.append(output.text)
            return None
        if isinstance(output, Ask) and output.method == "hello":
            return Refusal("no answer")
        return answer(output) if isinstance(output, Ask) else events.pop(0)

    return respond


def messages() -> list[Event]:
    return [Message(topic="wrench.left", raw={}, seq=k, boot="b", t_ns=k * 1_000_000_000) for k in range(60)]


def test_a_status_that_is_refused_is_asked_for_again() -> None:
    answers: list[Event] = [Refusal("no answer"), Reply("status")]
    assert follow(read_status(), host([], lambda _: answers.pop(0), messages())) == "status"  # type: ignore[comparison-overlap]
    with pytest.raises(SlipdError, match="the daemon does not answer: no answer"):
        follow(read_status(), host([], lambda _: Refusal("no answer"), messages()))


@pytest.mark.parametrize("step", [ReadingListener(["left"], "rig").collect(1.0), pause(60.0)])
def test_the_readings_of_a_step_and_a_pause_can_be_left_out(step: Steps[Any]) -> None:
    with pytest.raises(Skipped):
        follow(step, host([], Refusal, [Choice("perhaps"), Choice("skip")]))  # type: ignore[arg-type]


def test_weighing_is_refused_while_another_program_sends_gravity() -> None:
    streams = {"left.wrench": SimpleNamespace(gravity="compensated")}
    with pytest.raises(SlipdError, match="another program sends the direction of gravity for finger left"):
        follow(
            weigh(config.parse(RIG, "rig"), {}, ["left"]),
            host([], lambda _: Reply(SimpleNamespace(streams=streams)), []),
        )


def test_a_person_chooses_one_of_the_words() -> None:
    printed: list[str] = []
    prompt = Prompt("grasp", "Grip?", choices=("close", "skip"))
    events: list[Event] = [None, Choice("perhaps"), Choice("close")]
    assert follow(choose(prompt), host(printed, Refusal, events)) == "close"  # type: ignore[arg-type]
    assert printed == ["Grip?", "  please choose: close, skip"]
    with pytest.raises(Skipped):
        follow(choose(prompt), host([], Refusal, [Choice("skip")]))  # type: ignore[arg-type]


def test_too_few_poses_are_a_problem_of_this_step_alone() -> None:
    rig = config.parse(RIG, "rig")
    findings = follow(
        weigh(rig, {}, ["left"]),
        host([], lambda _: Reply(SimpleNamespace(streams={})), [Choice("not possible") for _ in POSES]),
    )
    assert findings["left"].problems == ["at least 3 poses are needed, got 0"]


@pytest.mark.parametrize(
    ("least", "limits", "force"),
    [
        (20.0, "max_force_n = 40.0", 20.0),
        (2.0, "max_force_n = 40.0", 5.0),
        (2.0, "max_force_n = 4.0", 4.0),
        (2.0, "", "[gripper] has no max_force_n"),
        (2.0, "max_force_n = 40.0\nmin_force_n = 8.0", 8.0),
    ],
)
def test_the_guide_grips_gently_and_within_the_limits(least: float, limits: str, force: float | str) -> None:
    found = gentle_force(config.parse(RIG + GRIPPER.format(least=least) + limits + "\n", "rig").gripper)
    assert str(found).startswith(force) if isinstance(force, str) else found == force


def test_a_noisy_force_sensor_asks_for_a_firmer_grip_to_show_a_slip() -> None:
    quiet = config.parse(RIG, "rig").finger.values()
    noisy = config.parse(RIG.replace("rate_hz", "torque_std_nm = 0.0015\nrate_hz", 1), "rig").finger.values()
    assert pulling_force(quiet) == 8.0
    assert pulling_force(noisy) == 22.0
    assert pulling_force([]) == 0.0
    gripper = config.parse(RIG + GRIPPER.format(least=2.0) + "max_force_n = 15.0\n", "rig").gripper
    assert gentle_force(gripper, pulling_force(quiet)) == 8.0
    assert gentle_force(gripper, pulling_force(noisy)) == 15.0


def test_keys_are_asked_for_where_the_daemon_needs_them(tmp_path: Path) -> None:
    for name in ("daemon", "me"):
        keys.create(name, tmp_path)
    tcp = f"""
[bus]
publish = "tcp://*:5556"
requests = "tcp://127.0.0.1:*"
secret_key = "{tmp_path}/daemon.key_secret"
readers = "{tmp_path}/readers"
requesters = "{tmp_path}/requesters"
"""
    rig, plain = config.parse(RIG + tcp, "rig"), config.parse(RIG, "rig")
    me, port = tmp_path / "me.key_secret", "tcp://127.0.0.1:5557"
    with pytest.raises(SlipdError, match="admits only clients with keys: give --key FILE"):
        link_to(rig, None, port, None, None)
    with pytest.raises(SlipdError, match=r"leaves the port .* open: give --requests as slipd run printed it"):
        link_to(rig, None, None, me, None)
    with pytest.raises(SlipdError, match="uses no keys; leave out --key"):
        link_to(plain, None, None, me, None)
    with pytest.raises(SlipdError, match="must hold a secret key"):
        link_to(rig, None, port, tmp_path / "me.key", None)
    found = link_to(rig, None, port, me, None)
    assert (found.publish, found.requests) == ("tcp://127.0.0.1:5556", port)
    assert found.publish_keys.server == keys.load_public(tmp_path / "daemon.key")
    assert link_to(plain, None, None, None, None).requests is None


@pytest.mark.parametrize(
    ("needed_n", "force_n", "words"),
    [
        (4.0, 5.0, []),
        (22.0, 22.0, ["hides a slip at less than 22 N"]),
        (22.0, 15.0, ["hides a slip at less than 22 N", "max_force_n allows 15 N: a slip may not be seen"]),
        (4.0, 3.0, ["max_force_n allows 3 N: a slip may not be seen"]),
        (22.0, "the config gives no limit", ["hides a slip at less than 22 N"]),
    ],
)
def test_the_guide_says_which_grip_the_noise_needs(needed_n: float, force_n: float | str, words: list[str]) -> None:
    said = [step.text for step in report_noise(needed_n, force_n) if isinstance(step, Say)]
    assert len(said) == len(words)
    assert all(word in text for word, text in zip(words, said, strict=True))


DEADLINE = "deadline_ns must not have passed: it passed 12 ms ago"


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (RequestRefused("deadline_passed", DEADLINE, "deadline_ns"), "the machine was too busy to answer in time"),
        (RequestRefused("lease_held", "another client holds the lease"), "end that program"),
        (RequestRefused("in_contact", "finger left is in contact", "finger"), "take away whatever touches the finger"),
        (RequestRefused("new_code", "of a newer daemon"), "of a newer daemon"),
        (TareGivenUp("moved", "the tare of left was given up"), "hold the gripper still"),
        (TareGivenUp("", "the tare of left was given up"), "given up"),
        (NoAnswer("no answer within 1 s"), "no answer within 1 s"),
    ],
)
def test_a_refusal_says_what_to_do(error: ClientError, words: str) -> None:
    assert words in reason_of(error)


def test_every_reason_of_a_tare_has_words() -> None:
    assert set(TARES) == set(TARE_REASONS)
