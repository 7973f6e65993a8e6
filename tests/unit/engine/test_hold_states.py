"""The state of the grasp in ``grasp``: through the engine, from the bytes of devices and requests to the messages."""

from __future__ import annotations

from engine_rig import GRIPPER, LEFT, RIGHT, Run
from grasp_table import grasp_table

from slipd.events import HostNotice, IncidentsChanged

RIG = LEFT + RIGHT + GRIPPER + grasp_table()


def states(run: Run) -> list[str]:
    """Return the states so far, without repetitions."""
    found = [body["state"] for body in run.published("grasp")]
    return [word for before, word in zip([None, *found], found, strict=False) if word != before]


def feel(run: Run, normal_n: float) -> None:
    for _ in range(20):
        run.feel(normal_n)
        run.serve_gripper(5)


def held() -> Run:
    run = Run(RIG)
    run.up()
    run.bring_up()
    run.grip()
    feel(run, 5.0)
    assert states(run)[-1] == "held"
    return run


def test_an_object_that_falls_is_lost_and_one_that_is_gripped_again_is_held() -> None:
    run = held()
    assert set(states(run)) == {"unknown", "empty", "held"}
    feel(run, 0.0)
    assert states(run)[-1] == "lost"
    first = next(body for body in run.published("grasp") if body["state"] == "lost")
    assert first["state_t_ns"] == run.published("grasp")[-1]["state_t_ns"] <= run.t_ns
    run.feel(5.0)
    run.serve_gripper(5)
    assert states(run)[-2:] == ["lost", "held"]


def test_an_object_that_is_put_down_is_not_lost() -> None:
    run = held()
    assert run.refusal("gripper.open", drop=True) is None
    run.gripper.found = 3
    run.serve_gripper(50)
    feel(run, 0.0)
    assert states(run)[-1] == "empty"
    assert "lost" not in states(run)


def test_a_pad_without_readings_makes_the_state_unknown_and_a_fall_meanwhile_is_a_loss() -> None:
    run = held()
    run.down("left.wrench")
    run.down("left.pad")
    assert states(run)[-1] == "held", "the change is published with the next event"
    run.tick()
    assert states(run)[-1] == "unknown"
    run.skin(0.0)
    run.skin(0.0)
    assert states(run)[-1] == "lost"


def test_a_notice_of_the_host_is_shown_until_it_ends() -> None:
    run = Run(LEFT)
    run.feed(HostNotice("config", "a\nfault"))
    assert run.published("status")[-1]["notices"] == {"config": r"a\nfault"}
    run.feed(HostNotice("config", ""))
    assert run.published("status")[-1]["notices"] == {}


def test_the_status_tells_of_incidents_only_where_they_are_kept() -> None:
    run = Run(LEFT)
    run.feed(HostNotice("config", ""))
    assert "incidents" not in run.published("status")[-1]
    run.feed(IncidentsChanged(0, 0, 0, 0, "", ""))
    none = {"saved": 0, "not_saved": 0, "lost": 0, "dropped": 0, "path": None, "failure": None}
    assert run.published("status")[-1]["incidents"] == none
    run.feed(IncidentsChanged(2, 1, 3, 4, "/state/a.mcap", "disk full"))
    some = {"saved": 2, "not_saved": 1, "lost": 3, "dropped": 4, "path": "/state/a.mcap", "failure": "disk full"}
    assert run.published("status")[-1]["incidents"] == some
