"""Gravity, friction and the name of the object: what makes verdicts more lenient needs the lease."""

from __future__ import annotations

from typing import Any

import pytest
from arm_rig import ARM, ArmRun
from arm_rig import RIG as ARM_RIG
from engine_rig import LEFT, RIG
from grasp_table import grasp_table
from run_courses import (
    Step,
    ask,
    bring_up,
    follow,
    image,
    lease,
    level,
    mu,
    newest,
    play,
    sleep,
    status,
    tick,
    wait,
    wrench,
)

BEN: dict[str, Any] = {"by": b"ben"}
L: dict[str, Any] = {"finger": "left"}
NO_LEASE, NOT_READY = ("no_lease", ""), ("not_ready", "finger")
FREE = "\n[requests]\nfriction_without_lease = true\n"
DOWN, TURNED = {"gravity_mps2": [0.0, 0.0, -9.8]}, {"gravity_mps2": [0.0, 0.0, 9.8]}
NEAR = wrench(10.0, (4.6, 0.0))


COURSES: dict[str, tuple[str, list[Step]]] = {
    # friction
    "friction is set for one finger and published": (
        RIG,
        [
            lease,
            ask("friction.set", {"mu": 0.8, "mu_source": "request", "mu_by": "ann", **L}, mu_s=0.8, mu_d=0.6, **L),
            image(),
            wrench(10.0, (1.0, 0.0)),
            newest("slip.left", mu=0.8, mu_source="request"),
            ask("friction.set", {"mu": 1.0}, mu_s=1, **L),
        ],
    ),
    "only the lease holder raises mu, and what is refused changes nothing": (
        RIG,
        [
            bring_up,
            image(),
            NEAR,
            level("warning", "translation"),
            ask("friction.set", NO_LEASE, mu_s=0.8, **L, **BEN),
            NEAR,
            level("warning", "translation"),
            newest("slip.left", mu=0.5),
            ask("friction.set", mu_s=0.8, **L),
            NEAR,
            level("stable"),
            mu(0.8),
        ],
    ),
    "a lease that ran out raises nothing": (
        RIG,
        [ask("friction.set", NO_LEASE, mu_s=0.6, **L), lease, wait(200), ask("friction.set", NO_LEASE, mu_s=0.6, **L)],
    ),
    "every client may set a stricter mu, or the same": (
        RIG,
        [
            lease,
            ask("friction.set", times=2, mu_s=0.3, **L, **BEN),
            ask("friction.set", NO_LEASE, mu_s=0.4, **L, **BEN),
            mu(0.3, "ben"),
            ask("friction.set", mu_s=0.5, **L),
        ],
    ),
    "a lower mu_d is more lenient, because a smaller fall is a slip": (
        RIG,
        [
            ask("friction.set", mu_s=0.5, mu_d=0.49, **L),
            ask("friction.set", NO_LEASE, mu_s=0.5, mu_d=0.2, **L),
            ask("friction.set", "a lower mu_d", mu_s=0.5, mu_d=0.2, **L),
        ],
    ),
    "any mu is more lenient than an unknown one": (
        LEFT.replace("mu = 0.5\n", ""),
        [
            ask(
                "friction.set",
                "mu_s 0.2, while no coefficient is stated, makes the verdicts on finger left more lenient",
                mu_s=0.2,
                **L,
            ),
            lease,
            ask("friction.set", ("out_of_range", "mu_s"), mu_s=2.01, **L),
            ask("friction.set", mu_s=2.0, **L),
        ],
    ),
    "a config may allow every client to raise mu up to mu_max, and to name the object": (
        LEFT.replace("mu = 0.5", "mu = 0.5\nmu_max = 1.5") + FREE,
        [
            ask("friction.set", mu_s=1.5, **L, **BEN),
            ask("friction.set", ("out_of_range", "mu_s"), mu_s=1.51, **L, **BEN),
            ask("object.set", name="mug", **BEN),
        ],
    ),
    "a rig without gripper has a lease for friction, and a tare needs none": (
        LEFT,
        [
            wrench(0.0),
            ask("tare", **L),
            ask("lease.renew", NO_LEASE),
            lease,
            ask("lease.acquire", ("lease_held", ""), ttl_ms=100, **BEN),
            ask("lease.acquire", ("out_of_range", "ttl_ms"), ttl_ms=201, **BEN),
            status(lease={"held": True, "expires_in_s": pytest.approx(0.2)}, gripper=None),
            ask("friction.set", NO_LEASE, mu_s=0.6, **L, **BEN),
            ask("friction.set", mu_s=0.6, **L),
            ask("lease.renew"),
            tick,
            sleep(100_000_000),
            ask("lease.renew", NO_LEASE),
            lease,
            ask("lease.release"),
            status(lease={"held": False, "expires_in_s": None}),
        ],
    ),
    # the object
    "an object is named with the friction in use for it": (
        RIG,
        [
            lease,
            ask(
                "object.set",
                {
                    "object_name": "mug-2",
                    "fingers": {name: {"mu": 0.5, "mu_source": "config"} for name in ("left", "right")},
                },
                name="mug-2",
            ),
            status(object_name="mug-2", object_by="ann", object_t_ns=100_000_000_000),
            ask("object.set", name=None),
            status(object_name=None),
            *(ask("object.set", {"object_name": name}, name=name) for name in ("mug", "Box_2.b-c", "7", "x" * 64)),
        ],
    ),
    "another name needs the lease, the same does not": (
        RIG,
        [
            ask("object.set", NO_LEASE, name="mug"),
            lease,
            ask("object.set", NO_LEASE, name="mug", **BEN),
            ask("object.set", name="mug"),
            ask("object.set", NO_LEASE, name="box", **BEN),
            ask("object.set", NO_LEASE, name=None, **BEN),
            ask("object.set", name="mug", **BEN),
        ],
    ),
    "a refusal says whether the lease can be had": (
        RIG,
        [
            ask("object.set", ": acquire the lease first (lease.acquire)", name="mug"),
            ask("friction.set", ": acquire the lease first (lease.acquire)", mu_s=0.6, **L),
            lease,
            ask("object.set", ": another client holds the lease", name="mug", **BEN),
            ask("friction.set", ": another client holds the lease", mu_s=0.6, **L, **BEN),
        ],
    ),
    # gravity
    "the gravity that the holder sends is set by no other client while it is fresh": (
        RIG,
        [
            ask("gravity.set", {"gravity": "none"}, by=b"arm", **DOWN, **L),
            lease,
            ask("gravity.set", by=b"arm", **DOWN, **L),
            ask("gravity.set", **DOWN, **L),
            ask("gravity.set", ("lease_held", "gravity_mps2"), by=b"arm", **TURNED, **L),
            wait(150),
            ask("lease.renew"),
            wait(150),
            ask("gravity.set", by=b"arm", **DOWN, **L),
        ],
    ),
    # a reflex acts on what a client states
    **{
        f"with a reflex, {op} needs the lease unless {key} is set": (
            f"{RIG}\n[reflex]\nenabled = true\n{grasp_table()}\n[requests]\n{key} = true\n",
            [
                ask("friction.set", None if key.startswith("friction") else NO_LEASE, mu_s=0.3, **L),
                ask("object.set", None if key.startswith("friction") else NO_LEASE, name="mug"),
                ask("gravity.set", None if key.startswith("gravity") else NO_LEASE, **DOWN, **L),
                ask("tare.undo", NO_LEASE, **L),
                ask(
                    op,
                    f"the reflex acts on {op}, so that it may move the gripper: acquire the lease first "
                    f"(lease.acquire); {free}_without_lease = true in [requests] of the config frees it",
                    **fields,
                    **L,
                ),
            ],
        )
        for key, op, free, fields in (
            ("friction_without_lease", "gravity.set", "gravity", DOWN),
            ("gravity_without_lease", "friction.set", "friction", {"mu_s": 0.02}),
        )
    },
    # every other request is refused, and changes nothing
    "a wrong request is refused with its code and field": (
        RIG,
        [
            lease,
            *(
                ask("friction.set", refusal, **{"mu_s": 0.5} | L | fields)
                for fields, refusal in (
                    ({"finger": "middle"}, ("unknown_finger", "finger")),
                    *(({"mu_s": wrong}, ("out_of_range", "mu_s")) for wrong in (0.0, 1.01, 10.0, -0.5)),
                    *(({"mu_d": wrong}, ("out_of_range", "mu_d")) for wrong in (0.51, 0.0)),
                    ({"mu_s": "0.5"}, ("bad_type", "mu_s")),
                    ({"mu_s": ...}, ("missing_field", "mu_s")),
                    ({"mu": 0.5}, ("unknown_field", "mu")),
                    ({"finger": None}, ("bad_type", "finger")),
                )
            ),
            *(
                ask("gravity.set", refusal, **DOWN | L | fields)
                for fields, refusal in (
                    ({"finger": "right"}, NOT_READY),
                    ({"finger": "middle"}, ("unknown_finger", "finger")),
                    ({"gravity_mps2": [0.0, 0.0, -98.0]}, ("out_of_range", "gravity_mps2")),
                    *(
                        ({"gravity_mps2": wrong}, ("bad_type", "gravity_mps2"))
                        for wrong in ([0.0, -9.8], -9.8, [0.0, 0.0, "down"], [0.0, 0.0, True])
                    ),
                    ({"gravity_mps2": ...}, ("missing_field", "gravity_mps2")),
                )
            ),
            *(ask(op, ("unknown_finger", "finger"), finger="middle") for op in ("tare", "tare.get", "tare.undo")),
            ask("tare", ("out_of_range", "stream"), stream="both", **L),
            ask("tare", ("not_ready", "stream"), finger="right", stream="wrench"),
            *(ask("object.set", ("out_of_range", "name"), name=n) for n in ("", "x" * 65, "mug\n", ".mug", "Größe")),
            ask(
                "object.set",
                "name must have 1 to 64 letters, digits, `.`, `_` and `-`, the first a letter or digit, got 'a mug'",
                name="a mug",
            ),
            ask("object.set", ("bad_type", "name"), name=3),
            ask("object.set", ("missing_field", "name")),
            ask("object.set", ("unknown_field", "finger"), name="mug", **L),
            status(object_name=None),
            mu(0.5, None, "config"),
        ],
    ),
}


@pytest.mark.parametrize("name", COURSES)
def test_a_course_of_requests(name: str) -> None:
    play(*COURSES[name])


def test_no_client_may_set_the_gravity_that_an_arm_stream_gives() -> None:
    run, refused = ArmRun(), ask("gravity.set", ("not_ready", "gravity_mps2"), gravity_mps2=[9.8, 0.0, 0.0], **L)
    given = ask("gravity.set", gravity_mps2=[9.8, 0.0, 0.0], **L)
    carry, carry_long = ArmRun.carry, lambda run: run.carry_for(1100)
    follow(run, [given, carry_long, lease, refused, wait(21), given, carry, refused])
    follow(ArmRun(ARM_RIG.replace(ARM, "")), [given])
