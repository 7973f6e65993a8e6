"""A sensor that was never tared gives no verdict it cannot justify. Through the engine."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from engine_rig import NO_IMAGE

from slipd.devices import xela
from slipd.events import Bytes
from slipd_client.messages import Health

Run = Any
Make = Callable[..., Run]

RAW = np.array([[16456, 16671, 37526], [16310, 16789, 37346], [16149, 16718, 37182], [15712, 16733, 37971]])
"""Counts of a real pad without a load: 150 N, if they were forces."""
NOT_TARED = "unknown", ["not_tared"]


def skin(run: Run, times: int = 3, press: int = 0, counts: np.ndarray = RAW) -> None:
    """Give messages of the right pad, whose counts flicker a little."""
    for k in range(times):
        run.wait(10)
        run._message += 1
        shown = counts + np.array((0, 0, press + k % 2))
        run.feed(Bytes("right.pad", xela.encode_message(run._message, {"2": shown}, 1.7e9)))


def go_on(run: Run, times: int, counts: int, normal_n: float = 0.0, tangential_n: float = 0.0) -> None:
    """Feed both sensors of the left finger every 10 ms."""
    for k in range(times):
        run.wait(5)
        run.tick()
        run.image(np.full((4, 4), counts + k % 2 * (counts > 0)))
        run.wrench(normal_n, (tangential_n, 0.0), ms=5.0)


def reported(run: Run, stream: str) -> tuple[Health, str]:
    found = run.ask("status", id=run.t_ns)["result"]["streams"][stream]
    return Health(found["health"]), found["message"]


@pytest.fixture
def untared(make_run: Make, right: str, gripper: str) -> Run:
    run = make_run(right.partition("tare =")[0] + gripper, zeros=False)
    run.up()
    return run


def test_pad_with_raw_counts_is_unknown_until_tared(untared: Run) -> None:
    run = untared
    skin(run)
    assert run.level("right") == NOT_TARED
    body = run.published("slip.right")[-1]
    assert (body["normal_n"], body["utilisation"], body["tare_origin"]) == (None, None, None)
    health, message = reported(run, "right.pad")
    assert health < Health.ERROR, "a stream that is read: a tare is all that is missing"
    assert "tare it while nothing touches the finger" in message
    run.lease()
    run.serve_gripper(50)
    assert run.refusal("gripper.activate") == ("in_contact", "drop"), "not known to be free"
    skin(run)
    assert run.ask("tare", finger="right", seconds=0.1)["result"]["verified"] is False
    skin(run, 14)
    assert run.level("right") == ("no_contact", [])
    assert "tare it" not in reported(run, "right.pad")[1]
    skin(run, 1, press=1000)
    assert run.level("right")[0] == "stable"
    skin(run)
    assert run.refusal("tare.undo", finger="right") is None
    skin(run, 1)
    assert run.level("right") == NOT_TARED, "as before the tare"


@pytest.mark.parametrize("counts", [0, 10, 5000, 9000])
def test_pad_with_a_physical_zero_is_unknown_too(untared: Run, counts: int) -> None:
    skin(untared, counts=np.full((4, 3), (0, 0, counts)))
    found = {(body["level"], *body["reasons"]) for body in untared.published("slip.right")}
    assert found == {("unknown", "not_tared")}, "it may hide a load, or show one that is none"


@pytest.mark.parametrize("normal_n", [0.0, 8.0, -8.0])
def test_force_sensor_is_unknown_but_for_a_clear_pull(make_run: Make, left: str, normal_n: float) -> None:
    run = make_run(left, zeros=False)
    run.up()
    for _ in range(30):
        run.image(NO_IMAGE)
        run.wrench(normal_n, ms=10.0)
    assert run.level() == NOT_TARED
    assert run.published("tactile.left")[-1]["image_reasons"] == ["not_tared"], "nothing shows that the pad is free"
    run.wrench(-30.0, ms=10.0)
    assert run.level() == ("unknown", ["pulled"])


@pytest.mark.parametrize("offset", [0, 300])
def test_images_of_an_untared_pad_count_once_it_is_seen_to_read_nothing_or_tared(
    make_run: Make, left: str, offset: int
) -> None:
    run = make_run(left, zeros=False)
    run.up()
    run.wrench(0.0)
    assert run.ask("tare", finger="left", seconds=0.05)["result"]["verified"] is False
    for _ in range(60):
        run.wrench(0.0)
    go_on(run, 30, offset)
    assert run.level() == ("no_contact", []), "by the force sensor"
    if offset:
        go_on(run, 1, offset, 8.0)
        assert run.level() == ("unknown", ["not_tared", "rotation_unobserved"])
        go_on(run, 3, offset, 8.0, 7.0)
        assert run.level() == ("warning", ["not_tared", "translation"]), "the force alone proves it"
        go_on(run, 1, offset)
        assert run.ask("tare", finger="left", stream="pad", seconds=0.1)["result"]["verified"] is True
        go_on(run, 14, offset)
    assert run.published("tactile.left")[-1]["tare_origin"] == ("measured" if offset else "observed")
    go_on(run, 1, offset + 100, 8.0)
    assert run.level() == ("stable", [])


def test_touch_that_the_pad_shows_first_is_not_an_offset(run: Run) -> None:
    run.bring_up()
    go_on(run, 10, 100)
    run.wrench(8.0)
    assert run.level() == ("stable", [])


def test_untared_sensor_is_not_tared_while_a_grip_is_in_force(make_run: Make, rig: str) -> None:
    """Its bias may be a load, and nothing else shows that the finger is free."""
    head, _, rest = rig.partition("[finger.left.pad]")
    run = make_run(head + rest[rest.index("[finger.right]") :], zeros=False)
    run.up()
    run.image = lambda *_: []
    run.bring_up(tare=False)
    assert run.ask("tare", finger="left", seconds=0.1)["result"]["verified"] is False, "nothing is held"
    assert run.ask("tare.undo", finger="left")["ok"]
    run.grip(5.0)
    refused = run.ask("tare", finger="left", seconds=0.1)["error"]
    assert (refused["code"], refused["field"]) == ("in_contact", "finger")
    assert "a grip is in force" in refused["message"]
