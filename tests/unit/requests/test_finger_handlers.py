"""Only the lease holder makes verdicts more lenient, within limits, and status shows who did it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from arm_rig import ARM, RIG, ArmRun

Run = Any


class TestFriction:
    def test_friction_is_set_for_one_finger_and_published(self, run: Run) -> None:
        run.lease()
        reply = run.ask("friction.set", finger="left", mu_s=0.8, mu_d=0.6)
        stated = {"mu": 0.8, "mu_source": "request", "mu_by": "ann", "mu_t_ns": run.t_ns}
        assert {key: reply["result"][key] for key in stated} == stated
        assert reply["result"]["finger"] == "left"
        run.image()
        run.wrench(10.0, (1.0, 0.0))
        body = run.published("slip.left")[-1]
        assert (body["mu"], body["mu_source"]) == (0.8, "request")
        assert run.ask("friction.set", finger="left", mu_s=1)["result"]["mu"] == 1.0

    @pytest.mark.parametrize(
        ("fields", "refusal"),
        [
            ({"finger": "middle"}, ("unknown_finger", "finger")),
            ({"mu_s": 0.0}, ("out_of_range", "mu_s")),
            ({"mu_s": 1.01}, ("out_of_range", "mu_s")),
            ({"mu_s": 10.0}, ("out_of_range", "mu_s")),
            ({"mu_s": -0.5}, ("out_of_range", "mu_s")),
            ({"mu_d": 0.51}, ("out_of_range", "mu_d")),
            ({"mu_d": 0.0}, ("out_of_range", "mu_d")),
            ({"mu_s": "0.5"}, ("bad_type", "mu_s")),
            ({"mu_s": ...}, ("missing_field", "mu_s")),
            ({"mu": 0.5}, ("unknown_field", "mu")),
        ],
    )
    def test_every_other_request_is_refused(self, run: Run, fields: dict[str, Any], refusal: tuple[str, str]) -> None:
        given = {"finger": "left", "mu_s": 0.5} | fields
        assert run.refusal("friction.set", **given) == refusal

    def test_only_the_lease_holder_may_raise_mu(self, run: Run) -> None:
        run.bring_up()
        run.image()
        run.wrench(10.0, (4.6, 0.0))
        assert run.level()[0] == "warning"
        raised = {"finger": "left", "mu_s": 0.8}
        assert run.refusal("friction.set", client=b"ben", **raised) == ("no_lease", "")
        run.wrench(10.0, (4.6, 0.0))
        assert run.level()[0] == "warning", "what was refused has changed nothing"
        assert run.published("slip.left")[-1]["mu"] == 0.5
        assert run.refusal("friction.set", client=b"ann", **raised) is None
        run.wrench(10.0, (4.6, 0.0))
        assert run.level()[0] == "stable"
        state = run.ask("status")["result"]["fingers"]["left"]
        set_ns = run.t_ns - 1_000_000
        stated = {"mu": 0.8, "mu_source": "request", "mu_by": "ann", "mu_t_ns": set_ns}
        assert {key: state[key] for key in stated} == stated

    def test_mu_is_not_raised_without_a_lease(self, run: Run) -> None:
        assert run.refusal("friction.set", finger="left", mu_s=0.6) == ("no_lease", "")
        run.lease()
        run.wait(200)
        assert run.refusal("friction.set", finger="left", mu_s=0.6) == ("no_lease", ""), "it ran out"

    def test_every_client_may_set_a_stricter_mu(self, run: Run) -> None:
        run.lease()
        assert run.refusal("friction.set", client=b"ben", finger="left", mu_s=0.3) is None
        assert run.refusal("friction.set", client=b"ben", finger="left", mu_s=0.3) is None, "the same is no change"
        assert run.refusal("friction.set", client=b"ben", finger="left", mu_s=0.4) == ("no_lease", "")
        assert run.ask("status")["result"]["fingers"]["left"]["mu_by"] == "ben"
        assert run.refusal("friction.set", finger="left", mu_s=0.5) is None, "its holder puts it back"

    def test_a_lower_mu_d_counts_as_more_lenient(self, run: Run) -> None:
        assert run.refusal("friction.set", finger="left", mu_s=0.5, mu_d=0.49) is None, "a smaller fall is a slip"
        assert run.refusal("friction.set", finger="left", mu_s=0.5, mu_d=0.2) == ("no_lease", "")
        assert "a lower mu_d" in run.ask("friction.set", finger="left", mu_s=0.5, mu_d=0.2)["error"]["message"]

    def test_any_mu_is_more_lenient_than_an_unknown_one(self, make_run: Callable[[str], Run], left: str) -> None:
        run = make_run(left.replace("mu = 0.5\n", ""))
        run.up()
        message = run.ask("friction.set", finger="left", mu_s=0.2)["error"]["message"]
        assert message.startswith(
            "mu_s 0.2, while no coefficient is stated, makes the verdicts on finger left more lenient"
        )
        run.lease()
        assert run.refusal("friction.set", finger="left", mu_s=2.01) == ("out_of_range", "mu_s")
        assert run.refusal("friction.set", finger="left", mu_s=2.0) is None

    def test_a_config_may_allow_every_client_to_raise_mu_up_to_mu_max(
        self, make_run: Callable[[str], Run], left: str
    ) -> None:
        free = "\n[requests]\nfriction_without_lease = true\n"
        run = make_run(left.replace("mu = 0.5", "mu = 0.5\nmu_max = 1.5") + free)
        run.up()
        assert run.refusal("friction.set", client=b"ben", finger="left", mu_s=1.5) is None
        assert run.refusal("friction.set", client=b"ben", finger="left", mu_s=1.51) == ("out_of_range", "mu_s")

    def test_a_rig_without_gripper_has_a_lease_for_friction(self, make_run: Callable[[str], Run], left: str) -> None:
        run = make_run(left)
        run.up()
        assert run.refusal("lease.renew") == ("no_lease", "")
        run.lease()
        assert run.refusal("lease.acquire", client=b"ben", ttl_ms=100) == ("lease_held", "")
        assert run.refusal("lease.acquire", client=b"ben", ttl_ms=201) == ("out_of_range", "ttl_ms")
        status = run.ask("status")["result"]
        assert status["lease"] == {"held": True, "expires_in_s": pytest.approx(0.2)}
        assert status["gripper"] is None
        assert run.refusal("friction.set", client=b"ben", finger="left", mu_s=0.6) == ("no_lease", "")
        assert run.refusal("friction.set", finger="left", mu_s=0.6) is None
        assert run.refusal("lease.renew") is None
        run.tick()
        run.tick(100_000_000)
        assert run.refusal("lease.renew") == ("no_lease", ""), "the host slept"
        run.lease()
        assert run.refusal("lease.release") is None
        assert run.ask("status")["result"]["lease"] == {"held": False, "expires_in_s": None}


class TestSensorsOfTheLeaseHolder:
    def test_no_other_client_may_tare_them(self, run: Run) -> None:
        run.bring_up()
        for op in ("tare", "tare.undo"):
            for stream in ("wrench", "pad"):
                asked = {"finger": "left", "stream": stream}
                assert run.refusal(op, client=b"ben", **asked) == ("lease_held", "")
        assert run.ask("tare.get", client=b"ben", finger="left")["result"]["tare_id"] == 1
        assert run.refusal("tare.undo", finger="left") is None, "the holder may"
        run.ask("lease.release")
        run.feel(0.0)
        assert run.refusal("tare", client=b"ben", finger="left") is None, "nobody holds the lease"

    def test_only_the_holder_may_undo_a_tare_in_contact(self, run: Run) -> None:
        run.bring_up()
        run.ask("lease.release")
        run.feel(5.0)
        assert run.refusal("tare.undo", finger="left") == ("no_lease", "")
        assert run.ask("tare.get", finger="left")["result"]["tare_id"] == 1
        run.lease()
        assert run.refusal("tare.undo", finger="left") is None

    def test_a_rig_without_gripper_is_tared_without_a_lease(self, make_run: Callable[[str], Run], left: str) -> None:
        run = make_run(left)
        run.up()
        run.wrench(0.0)
        assert run.refusal("tare", finger="left") is None

    def test_no_other_client_may_set_the_gravity_that_the_holder_sets(self, run: Run) -> None:
        down, up = [0.0, 0.0, -9.8], [0.0, 0.0, 9.8]
        assert run.refusal("gravity.set", client=b"arm", finger="left", gravity_mps2=down) is None
        run.lease()
        assert run.refusal("gravity.set", client=b"arm", finger="left", gravity_mps2=down) is None, "the arm's own"
        assert run.refusal("gravity.set", finger="left", gravity_mps2=down) is None
        assert run.refusal("gravity.set", client=b"arm", finger="left", gravity_mps2=up) == (
            "lease_held",
            "gravity_mps2",
        )
        run.wait(150)
        assert run.refusal("lease.renew") is None
        run.wait(150)
        refusal = run.refusal("gravity.set", client=b"arm", finger="left", gravity_mps2=down)
        assert refusal is None, "that of the holder is stale"

    def test_no_client_may_set_the_gravity_that_an_arm_stream_gives(self) -> None:
        run, down = ArmRun(), {"finger": "left", "gravity_mps2": [9.8, 0.0, 0.0]}
        assert run.refusal("gravity.set", **down) is None, "the stream has not begun"
        run.carry_for(1100)
        run.lease()
        assert run.refusal("gravity.set", **down) == ("not_ready", "gravity_mps2"), "nor may who holds the lease"
        run.wait(21)
        assert run.refusal("gravity.set", **down) is None, "the stream is stale"
        run.carry()
        assert run.refusal("gravity.set", **down) == ("not_ready", "gravity_mps2"), "it counts at once"
        bare = ArmRun(RIG.replace(ARM, ""))
        assert bare.refusal("gravity.set", **down) is None
