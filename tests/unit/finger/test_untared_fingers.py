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


class TestNeverTared:
    """Raw counts have any offset: without a tare they give no load, and no verdict."""

    UNLOADED = np.array([[16456, 16671, 37526], [16310, 16789, 37346], [16149, 16718, 37182], [15712, 16733, 37971]])

    def skin(self, run: Run, press: int = 0) -> None:
        """A message of the right pad with the raw counts of a real one."""
        run.wait(10)
        run._message += 1
        run.feed(
            Bytes("right.pad", xela.encode_message(run._message, {"2": self.UNLOADED + np.array((0, 0, press))}, 1.7e9))
        )

    def message(self, run: Run, stream: str) -> tuple[Health, str]:
        reported = run.ask("status", id=run.t_ns)["result"]["streams"][stream]
        return Health(reported["health"]), reported["message"]

    def untared(self, make_run: Callable[..., Run], right: str) -> Run:
        run = make_run(right.partition("tare =")[0], zeros=False)
        run.up()
        return run

    def test_pad_with_raw_counts_is_unknown_until_tared(self, make_run: Callable[..., Run], right: str) -> None:
        run = self.untared(make_run, right)
        for _ in range(3):
            self.skin(run)
        assert run.level("right") == ("unknown", ["not_tared"]), "150 N without a load"
        body = run.published("slip.right")[-1]
        assert (body["normal_n"], body["utilisation"], body["tare_origin"]) == (None, None, None)
        health, message = self.message(run, "right.pad")
        assert health < Health.ERROR, "a stream that is read: a tare is all that is missing"
        assert "tare it while nothing touches the finger" in message
        assert run.ask("tare", finger="right", seconds=0.1)["result"]["verified"] is False
        for _ in range(14):
            self.skin(run)
        assert run.level("right") == ("no_contact", [])
        assert "tare it" not in self.message(run, "right.pad")[1]
        self.skin(run, press=1000)
        assert run.level("right")[0] == "stable"
        for _ in range(3):
            self.skin(run)
        assert run.refusal("tare.undo", finger="right") is None
        self.skin(run)
        assert run.level("right") == ("unknown", ["not_tared"]), "as before the tare"

    def test_gripper_is_not_activated_on_it(self, make_run: Callable[..., Run], right: str, gripper: str) -> None:
        run = make_run(right.partition("tare =")[0] + gripper, zeros=False)
        run.up()
        for _ in range(3):
            self.skin(run)
        run.lease()
        run.serve_gripper(50)
        assert run.refusal("gripper.activate") == ("in_contact", "drop"), "not known to be free"

    @pytest.mark.parametrize("counts", [0, 10, 5000, 9000])
    def test_pad_with_a_physical_zero_is_unknown_too(
        self, make_run: Callable[..., Run], right: str, counts: int
    ) -> None:
        run = self.untared(make_run, right)
        for k in range(3):
            run.wait(10)
            run.feed(Bytes("right.pad", xela.encode_message(k, {"2": np.full((4, 3), (0, 0, counts + k))}, 1.7e9)))
        found = {(body["level"], *body["reasons"]) for body in run.published("slip.right")}
        assert found == {("unknown", "not_tared")}, "it may hide a load, or show one that is none"

    @pytest.mark.parametrize("normal_n", [0.0, 8.0, -8.0])
    def test_force_sensor_is_unknown_but_for_a_clear_pull(
        self, make_run: Callable[..., Run], left: str, normal_n: float
    ) -> None:
        run = make_run(left, zeros=False)
        run.up()
        for _ in range(30):
            run.image(NO_IMAGE)
            run.wrench(normal_n, ms=10.0)
        assert run.level() == ("unknown", ["not_tared"])
        assert run.published("tactile.left")[-1]["image_reasons"] == ["not_tared"], "nothing shows that the pad is free"
        run.wrench(-30.0, ms=10.0)
        assert run.level() == ("unknown", ["pulled"])

    def go_on(self, run: Run, times: int, counts: int, normal_n: float = 0.0, tangential_n: float = 0.0) -> None:
        """Feed both sensors of the left finger every 10 ms."""
        for k in range(times):
            run.wait(5)
            run.tick()
            run.image(np.full((4, 4), counts + k % 2 * (counts > 0)))
            run.wrench(normal_n, (tangential_n, 0.0), ms=5.0)

    @pytest.fixture
    def half_tared(self, make_run: Callable[..., Run], left: str) -> Run:
        """The force sensor is tared, the pad in front of it is not."""
        run = make_run(left, zeros=False)
        run.up()
        run.wrench(0.0)
        assert run.ask("tare", finger="left", seconds=0.05)["result"]["verified"] is False
        for _ in range(60):
            run.wrench(0.0)
        return run

    def test_images_beside_a_force_sensor_are_not_used(self, half_tared: Run) -> None:
        run = half_tared
        self.go_on(run, 30, 300)
        assert run.level() == ("no_contact", []), "by the force sensor"
        self.go_on(run, 1, 300, 8.0)
        assert run.level() == ("unknown", ["not_tared", "rotation_unobserved"])
        self.go_on(run, 3, 300, 8.0, 7.0)
        assert run.level() == ("warning", ["not_tared", "translation"]), "the force alone proves it"
        self.go_on(run, 1, 300)
        assert run.ask("tare", finger="left", stream="pad", seconds=0.1)["result"]["verified"] is True
        self.go_on(run, 14, 300)
        self.go_on(run, 1, 400, 8.0)
        assert run.level() == ("stable", [])

    def test_pad_that_reads_nothing_while_the_force_sensor_measures_nothing_needs_no_tare(
        self, half_tared: Run
    ) -> None:
        run = half_tared
        self.go_on(run, 30, 0)
        assert run.published("tactile.left")[-1]["tare_origin"] == "observed"
        self.go_on(run, 1, 100, 8.0)
        assert run.level() == ("stable", [])

    def test_touch_that_the_pad_shows_first_is_not_an_offset(self, run: Run) -> None:
        run.bring_up()
        self.go_on(run, 10, 100)
        run.wrench(8.0)
        assert run.level() == ("stable", [])


def test_untared_sensor_is_not_tared_while_a_grip_is_in_force(make_run: Callable[..., Run], rig: str) -> None:
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
