"""``slipctl friction measure`` leads a person through three pulls and prints what they show; it only reads."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Callable, Iterable
from contextlib import nullcontext
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, cast

import pytest
from pulls import Hand, typed

from slipd_client import friction_guide
from slipd_client.friction_session import NO_SLIP
from slipd_client.messages.schema.topics import Slip
from slipd_client.slipctl import main

if TYPE_CHECKING:
    from conftest import Daemon

STATUS: dict[str, Any] = {
    "fingers": {"left": {"level": "stable"}, "right": {"level": "stable"}},
    "streams": {"left.wrench": {"health": 0}, "right.wrench": {"health": 0}},
}


@pytest.fixture
def played(
    daemon: Daemon, monkeypatch: pytest.MonkeyPatch, stepped: Callable[[Any], Any]
) -> Callable[[Iterable[dict[str, Any]]], list[str]]:
    """Lets slipctl hear verdicts, each when its time has come; returns its arguments."""
    daemon.handlers["status"] = lambda _: STATUS
    clock = stepped(friction_guide)

    def play(bodies: Iterable[dict[str, Any]]) -> list[str]:
        left = iter(bodies)

        def receive(timeout_s: float) -> Slip | None:
            clock.sleep(1.0 / Hand.hz)
            return cast("Slip", typed(body)) if (body := next(left, None)) else None

        heard = nullcontext(SimpleNamespace(receive=receive, check_silence=lambda: pytest.fail("nothing more comes")))
        monkeypatch.setattr(friction_guide, "Subscriber", lambda *_, **__: heard)
        return ["--requests", daemon.endpoint, "friction", "measure"]

    return play


def pulled(*coefficients: float) -> list[dict[str, Any]]:
    """Hold and pull the left finger once for each coefficient."""
    hand, bodies = Hand(), []
    for mu in coefficients:
        hand.mu_s, hand.mu_d = mu, 0.8 * mu
        bodies += hand.once()
    return bodies


def test_three_pulls_give_lines_for_the_config(
    played: Callable[..., list[str]], daemon: Daemon, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([*played(pulled(0.50, 0.52, 0.54, 0.54)), "left"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "Pull slowly along the pads until it slips, 1 of 3 (left 10.0 N)."
    assert lines.count("Let go of it.") >= 2
    shown = [line for line in lines if "slips at" in line]
    assert [float(line.split()[3].strip(",")) for line in shown] == pytest.approx([0.50, 0.52, 0.54], rel=0.01)
    assert all("while it slides, 10.0 N" in line for line in shown)
    result = next(line for line in lines if line.startswith("left: "))
    assert result.startswith("left: static friction 0.51")
    assert "dynamic friction 0.41" in result
    found = tomllib.loads("\n".join(lines[lines.index(result) + 1 :]))["finger"]["left"]
    assert found == {"mu": pytest.approx(0.489, rel=0.01), "mu_spread": pytest.approx(0.059, rel=0.1)}
    assert set(daemon.ops) == {"hello", "status"}, "it asks for nothing that moves or sets anything"


def test_as_json_the_result_is_one_document_and_the_guide_is_on_standard_error(
    played: Callable[..., list[str]], call: Callable[..., tuple[int, str, str]]
) -> None:
    code, out, errors = call(*played(pulled(0.5)), "left", "--samples", "1", "--json")
    assert (code, list(found := json.loads(out)["left"])) == (0, ["mu", "mu_spread", "mu_s", "mu_d", "normal_n"])
    assert found["mu_s"] == pytest.approx(0.5, rel=0.01)
    assert found["mu"] == pytest.approx(found["mu_s"] * (1.0 - found["mu_spread"]))
    assert errors.startswith("Pull slowly")


@pytest.mark.parametrize(
    ("fields", "asked", "why"),
    [
        (
            {"level": "no_contact", "normal_n": 0.0, "required_friction": None},
            "Grip a sample of the object, for example with: slipctl grip close 10\n",
            "finger left: nothing touches the pad",
        ),
        ({}, "Pull slowly along the pads until it slips, 1 of 3 (left 10.0 N).\n", NO_SLIP),
    ],
)
def test_where_nothing_happens_it_says_what_to_do_and_gives_up_in_the_end(
    played: Callable[..., list[str]],
    call: Callable[..., tuple[int, str, str]],
    fields: dict[str, Any],
    asked: str,
    why: str,
) -> None:
    arguments = [*played(Hand(more=fields).rest(600.0)), "left", "--patience", "0.5"]
    assert call(*arguments) == (1, asked, f"slipctl: nothing more was measured for 0.5 s: {why}\n")


def test_a_sensor_with_a_fault_and_a_wrong_name_are_told_before_anything_else(
    daemon: Daemon, capsys: pytest.CaptureFixture[str], stepped: Callable[[Any], None]
) -> None:
    stepped(friction_guide)
    ill = {"left.wrench": {"health": 2, "message": "overloaded"}, "right.wrench": {"health": 0}}
    daemon.handlers["status"] = lambda _: STATUS | {"streams": ill}
    assert main(["--requests", daemon.endpoint, "friction", "measure", "left"]) == 1
    assert daemon.ops.count("status") > 1, "a sensor may just begin"
    assert capsys.readouterr().err == "slipctl: left.wrench is ERROR: overloaded\n"
    late = {"error": {"code": "deadline_passed", "message": "it came too late"}}
    answers = iter([late, late])
    daemon.handlers["status"] = lambda _: next(answers, STATUS)
    assert main(["--requests", daemon.endpoint, "friction", "measure", "middle"]) == 1
    assert capsys.readouterr().err == "slipctl: finger must be one of left, right, got 'middle'\n"
