"""Motion that the load does not show: through the engine, from the bytes of devices to the messages."""

from __future__ import annotations

import numpy as np
import pytest
from engine_rig import LEFT, RIG, RIGHT, Run
from grasp_table import grasp_table
from nanoseconds import MS
from run_courses import (
    Step,
    bring_up,
    down,
    feel,
    follow,
    grip,
    gripper,
    image,
    newest,
    play,
    serve,
    tick,
    wait,
    wrench,
)

from slipd.devices.external import encode_reading
from slipd.events import Bytes
from slipd.motion.evidence import Evidence

FINE = (
    LEFT.replace("rows = 4", "rows = 8")
    .replace("cols = 4", "cols = 16")
    .replace("force_std_n = 0.0", "force_std_n = 0.02")
)
OBSERVED = f"""
{grasp_table()}
[grasp.object]
device = "external"
port = "ipc:///tmp/object"
sensor = "object"
rate_hz = 50.0
std_m = 0.0005
"""


def patch(x_m: float) -> np.ndarray:
    """Return what each taxel of the fine pad feels of a contact at ``x_m``, N: 8 N with soft edges."""
    x, y = np.meshgrid((np.arange(16) - 7.5) * 0.004, (np.arange(8) - 3.5) * 0.004)
    loads = 1.0 / (1.0 + np.exp((np.hypot(x - x_m, y) - 0.010) / 0.001))
    return 8.0 * loads / loads.sum()


def slips(run: Run, finger: str = "left") -> list[dict[str, object]]:
    """Return the messages of a finger that report a slip."""
    return [body for body in run.published(f"slip.{finger}") if body["level"] == "slipping"]


def hold(
    run: Run,
    seconds: float,
    speed_mps: float,
    rng: np.random.Generator,
    x_m: float = 0.0,
    across_n: float = 2.0,
) -> float:
    """Hold 8 N and ``across_n`` while the contact moves over the pad: force at 500 Hz, images at 100 Hz.

    Returns:
        Where the contact is in the end, m; it begins at ``x_m``.
    """
    for k in range(round(seconds * 500)):
        x_m += speed_mps / 500
        normal_n, pull_n = 8.0 + rng.normal(0.0, 0.02), across_n + rng.normal(0.0, 0.02)
        run.wrench(normal_n, (pull_n, rng.normal(0.0, 0.02)), centroid_m=(x_m, 0.0), ms=2.0)
        if k % 5 == 0:
            run.image(np.round(patch(x_m) * 100 + rng.normal(0.0, 0.5, (8, 16))).astype(int))
    return x_m


FREE: list[Step] = [image(np.zeros((8, 16), dtype=int)), wrench(0.0)] * 3
CLOSED: list[Step] = [bring_up, grip(5.0), gripper(position=120)]


def test_a_contact_that_creeps_over_the_pad_is_a_slip() -> None:
    run, rng = play(FINE, FREE), np.random.default_rng(1)
    for x_m in (-0.001, 0.0):
        follow(run, [wrench(0.0)] * 3)
        hold(run, 1.0, 0.0, rng, x_m)
    assert slips(run) == [], "another grip of it, a little elsewhere, before the next image, is no motion"
    began_ns = run.t_ns
    x_m = hold(run, 1.5, 0.001, rng)
    found = slips(run)
    assert (found[0]["evidence"], found[0]["t_ns"] - began_ns < 1000 * MS) == (["image_change"], True), "within 1 mm"
    assert {body["level"] for body in run.published("slip.left") if body["t_ns"] > found[0]["t_ns"]} == {"slipping"}
    hold(run, 1.5, 0.0, rng, x_m)
    newest("slip.left", level="warning", reasons=["translation"], mu_source="learned")(run)  # it ends with the motion
    after = run.published("slip.left")[-1]
    assert 0.98 * after["mu_low"] < after["required_friction"] < after["mu_high"] < 0.5, "it slid under this load"
    hold(run, 1.0, 0.0, rng, x_m, across_n=0.8)
    assert run.level()[0] == "stable", "friction that was learned carries less"


def test_weak_evidence_of_an_image_is_no_motion() -> None:
    run = play(FINE, FREE)
    finger = run.engine._fingers["left"]
    for surprise in (1.0, 2.0):
        finger.motion_evidence = Evidence("image_change", 0, surprise)
        assert run.engine._motion.update_image(finger) == []
    run.image(patch(0.0).astype(int))
    assert finger.motion_evidence is None, "it is that of the newest image"


@pytest.mark.parametrize("steps", [1, 4])
def test_jaws_that_move_by_themselves_are_a_slip_of_both_fingers(steps: int) -> None:
    held: list[Step] = [serve(20), feel(5.0), serve(20), feel(5.0), feel(5.0)] * 60
    run = play(RIG, [*CLOSED, *held, gripper(position=120 + steps), *held])
    for finger in ("left", "right"):
        assert [body["evidence"] for body in slips(run, finger)][:1] == ([] if steps == 1 else [["width"]])


def test_an_object_that_another_process_sees_move_is_a_slip() -> None:
    run, rng = play(LEFT + RIGHT + OBSERVED), np.random.default_rng(2)

    def see(seconds: float, speed_mps: float, *status: str) -> None:
        for k in range(round(seconds * 50)):
            follow(run, [feel(5.0), wait(8)] * 2)
            at_m = np.array((0.0, 0.0, 0.1 + speed_mps * k / 50)) + rng.normal(0.0, 3e-4, 3)
            run.feed(Bytes("object", encode_reading("object", run.t_ns, object_pose={"xyz_m": at_m}, status=status)))

    see(3.0, 0.0)
    see(0.5, 0.02, "invalid")
    assert slips(run) == [], "what its sender does not trust shows nothing"
    see(1.0, 0.02)
    for finger in ("left", "right"):
        assert slips(run, finger)[0]["evidence"] == ["external"]
    follow(run, [wait(1100), tick, newest("status", streams={"object": {"samples": 225}}), down("object")])
