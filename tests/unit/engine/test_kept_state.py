"""What a run takes over from the run before it: only what is of the same device and config, and recent."""

from __future__ import annotations

import copy
import functools
import json
from collections.abc import Callable
from typing import Any

import pytest
from engine_rig import BOOT, RIG, WALL_NS, Run
from run_courses import (
    Step,
    ask,
    bring_up,
    down,
    feel,
    follow,
    grip,
    gripper,
    lease,
    level,
    matches,
    newest,
    no_image,
    serve,
    skin,
    slip,
    status,
    up,
    wait,
    wrench,
)

from slipd import config
from slipd.engine.engine import Engine
from slipd.events import LinkUp, StateRestored
from slipd.gripper.stored_state import seal

SECOND = 1_000_000_000
EARLIER = BOOT.replace("b", "a")


def kept(run: Run) -> dict[str, Any]:
    """What a run keeps for the next one, as by another boot."""
    return json.loads(run.engine.kept.text(run.t_ns).partition(" ")[2]) | {"boot": EARLIER}


QUIET: list[Step] = [serve(10), feel(0.0)] * 30
"""The tared force sensor measures nothing, and the pad before it shows nothing."""
HELD = [up(), bring_up, *QUIET, ask("tare", finger="right", seconds=0.05), skin(0.0, times=12), grip(5.0), serve(50)]
BEGINNINGS: dict[str, list[Step]] = {
    "held": HELD,
    "slipped": [*HELD, ask("object.set", name="mug"), slip],
    "slipped without a name": [*HELD, slip],
}


@functools.cache
def begun(kind: str) -> Run:
    """What many courses begin with is run once."""
    run = Run(RIG, zeros=False)
    follow(run, BEGINNINGS[kind])
    return run


Change = Callable[[dict[str, Any]], object]
RESUMED: list[Step] = [up(), *[feel(5.0), serve(10)] * 20, feel(5.0)]
"""The devices answer, and both fingers go on to feel 5 N."""


def unchanged(_: dict[str, Any]) -> None:
    """The state is as it was kept."""


def begin_beside(before: Run) -> Run:
    """Begin a new run beside the same devices, a second later; its links are not open yet."""
    run = Run(RIG, zeros=False)
    run.gripper, run.t_ns = before.gripper, before.t_ns + SECOND
    return run


def restart(*steps: Step, change: Change = unchanged, damage: Callable[[str], str] = str) -> Step:
    """Begin a new run beside the same devices, with what this one kept, and follow it; its links are not open yet."""

    def step(before: Run) -> None:
        state = kept(before)
        change(state)
        run = begin_beside(before)
        run.feed(StateRestored(damage(seal(json.dumps(state)))))
        follow(run, steps)

    return step


def set_of(*path: str, **values: Any) -> Change:
    """Return a change of a part of the state."""

    def change(state: dict[str, Any]) -> None:
        functools.reduce(dict.__getitem__, path, state).update(values)

    return change


def recorded(state: dict[str, Any]) -> None:
    """A recording begins with this state of its own run, and does not hold the name of the device."""
    state["boot"] = BOOT
    set_of("tares", "left.wrench", device="S/N 7")(state)


def keeps(**expected: Any) -> Step:
    """Check the grip that a run keeps."""

    def step(run: Run) -> None:
        assert matches(kept(run)["grip"], expected), kept(run)["grip"]

    return step


def forgotten(run: Run) -> None:
    """The grip of 7 N that was kept is neither in force nor kept on."""
    assert run.published("gripper")[-1]["force_command_n"] != 7.0
    assert (kept(run)["grip"] or {}).get("force_n") != 7.0


def zero(origin: str | None, number: int | None = None, stream: str = "left.wrench") -> Step:
    """Check where the zero of a stream comes from."""
    found = {"tare_origin": origin, "tare_id": int(origin is not None) if number is None else number}
    return status(streams={stream: found})


def said(words: str, stream: str = "left.wrench") -> Step:
    """Check the message of a stream, or the notice on the state."""

    def step(run: Run) -> None:
        found = run.ask("status")["result"]
        assert words in (found["streams"][stream]["message"] if stream else found["notices"]["state"])

    return step


def friction(name: str | None, left: Any, right: float = 0.5) -> Step:
    """Check the object, and the coefficient of static friction in use on each finger."""
    return status(object_name=name, fingers={"left": {"mu": left}, "right": {"mu": right}})


def meanwhile_restored(run: Run) -> None:
    """What the run kept itself is handed to it."""
    run.feed(StateRestored(seal(json.dumps(kept(run)))))


def unreadable(run: Run) -> None:
    run.feed(StateRestored("", "state.json: Permission denied"))


def not_confirmed(state: dict[str, Any]) -> None:
    state["grip"]["width_m"] += 0.01


def like_another(state: dict[str, Any]) -> None:
    state["grip"]["force_n"] = 7.0


def before_friction(state: dict[str, Any]) -> None:
    del state["grip"]["friction"], state["grip"]["named"]


def impossible(slips: list[list[float]]) -> Change:
    """Return a change of the friction kept to what is not stricter, or cannot be; and of a finger that is not there."""
    return lambda state: state["grip"].update(
        friction={"left": [[slips, None]] * 2, "another finger": state["grip"]["friction"]["left"]}
    )


def set_equal(found: Any, expected: Any) -> None:
    assert set(found) == set(expected.split() if isinstance(expected, str) else expected)


ADJUSTED = ask("grip.adjust", {"applied_n": pytest.approx(6.0)}, delta_n=1.0)
LEARNED = pytest.approx(0.21, abs=0.01)
UNKNOWN = ("unknown", "not_tared")
FREE: list[Step] = [feel(0.0), serve(10)] * 5
WHY = "the state of the run before is not used: state.json: Permission denied"
COURSES: dict[str, tuple[str, list[Step]]] = {
    "a restart in a grasp goes on with the zeros and the grip in force": (
        "held",
        [
            restart(
                *RESUMED, zero("stored"), zero("stored", 0, "left.pad"), zero("stored", 1, "right.pad"),
                level("stable"), level("stable", finger="right"),
                newest("slip.left", tare_origin="stored", tare_age_s=pytest.approx(1.8, abs=0.5)),
                ask("tare.get", {"by": "ann", "readings": 10, "tare_origin": "stored"}, finger="left"),
                lease, ADJUSTED, keeps(raised_n=pytest.approx(1.0)),
            )
        ],
    ),
    **{
        f"a kill while the gripper is silent keeps the grip, unplugged: {bool(gone)}": (
            "held",
            [
                gripper(silent=True), serve(2000), *gone, newest("gripper", object=None), keeps(force_n=5.0),
                gripper(silent=False), restart(*RESUMED, lease, ADJUSTED),
            ],
        )
        for gone in ([], [down("gripper")])
    },
    "F6 a stored zero that a clear pull contradicts is not used": (
        "held",
        [
            restart(
                *RESUMED, zero("stored"), *[feel(-4.0)] * 30, zero(None),
                said("the stored zero does not fit: the normal force is clearly negative"), *[feel(5.0)] * 30,
                level(*UNKNOWN),
            )
        ],
    ),
    "a stored zero is not used where its device answers too late": (
        "held",
        [
            restart(
                wait(3700_000), up(), wrench(0.0), zero(None), said("the device answers too late for restart.gap_s"),
                ask("tare", finger="left", seconds=0.01), wrench(0.0, times=20), zero("measured"),
                status(streams={"left.wrench": {"message": ""}}),
            )
        ],
    ),
    "a stored zero replaces none that was measured meanwhile": (
        "held", [meanwhile_restored, feel(5.0), zero("measured")],
    ),
    "a stored zero is not used where its device never reports that it is the one": (
        "held", [restart(*RESUMED, zero(None), change=set_of("tares", "left.wrench", device="S/N 7"))],
    ),
    "a recording that began during a run has the zero of a device that told its name before": (
        "held", [restart(*RESUMED, zero("measured"), change=recorded)],
    ),
    "a stored zero is kept while no device answers, and gives way to one of this run": (
        "held",
        [
            restart(
                lambda run: set_equal(kept(run)["tares"], "left.wrench left.pad right.pad"), up(), *[no_image] * 3,
                wrench(0.0), zero("stored"), ask("tare", finger="left", seconds=0.01), wrench(0.0, times=20),
                zero("measured", 2),
            )
        ],
    ),
    **{
        f"a tare serves at about the temperature of its sensor, {told} °C": (
            "held",
            [
                lambda run: set_equal([kept(run)["tares"]["left.wrench"]["temperature_c"]], [25.0]),
                restart(
                    *RESUMED, zero("stored"),
                    lambda run, told=told: set_equal([kept(run)["tares"]["left.wrench"]["temperature_c"]], [told]),
                    change=set_of("tares", "left.wrench", temperature_c=told),
                ),
            ],
        )
        for told in (15.0, 35.0, None)
    },
    "a state that cannot be read is reported and nothing of it is used": (
        "held", [restart(unreadable, up(), status(notices={"state": WHY}))],
    ),
    **{
        f"a grip that the gripper does not confirm is forgotten: {what}": (
            "held", [gripper(**found), restart(*RESUMED, forgotten, change=changed)],
        )
        for what, found, changed in (
            ("no object", {"found": 3}, like_another), ("inactive", {"stage": 0, "outputs": (0, 0, 0)}, like_another),
            ("width", {}, lambda state: (like_another(state), not_confirmed(state))),
        )
    },
    # friction
    **{
        f"A10 what a slip taught goes on with the grip, and with its name: {name}": (
            "slipped" if name else "slipped without a name",
            [
                friction(name, LEARNED),
                restart(
                    *RESUMED, friction(name, LEARNED), level("stable"), newest("slip.left", mu_source="learned"),
                    status(object_by=None, object_t_ns=None),  # no client of this run named it
                    restart(
                        *RESUMED, friction(name, LEARNED),  # nor does a second kill lose it
                        *FREE, friction(name, pytest.approx(0.2, abs=0.02) if name else 0.5),
                    ),
                ),
            ],
        )
        for name in ("mug", None)
    },
    "what a slip taught waits for the gripper": (
        "slipped",
        [
            restart(
                keeps(force_n=5.0), up(), feel(5.0), friction(None, 0.5), *[serve(10), feel(5.0)] * 5,
                friction("mug", LEARNED),
            )
        ],
    ),
    "what a slip taught is not used where the gripper does not confirm the grip": (
        "slipped", [restart(*RESUMED, friction(None, 0.5), change=not_confirmed)],
    ),
    **{
        f"what a client states before the gripper answers counts instead: {op}": (
            "slipped",
            [restart(up(), lease, ask(op, **fields), serve(50), keeps(force_n=5.0), friction(name, mu))],
        )
        for op, fields, name, mu in (
            ("object.set", {"name": "box"}, "box", 0.5),
            ("friction.set", {"finger": "left", "mu_s": 0.4}, "mug", 0.4),
        )
    },
    **{
        f"friction that is not stricter or cannot be is ignored: {slips}": (
            "slipped", [restart(*RESUMED, friction("mug", 0.5), change=impossible(slips))],
        )
        for slips in (
            [[-0.1, 0.01]], [[-1.5, 0.0]], [[-1.5, -1.0]], [[1e300, 0.01]], [[-1.5, 1e300]], [[-1.5, 5e-324]], [],
        )
    },
    "a state of before friction was kept is read": (
        "slipped", [restart(*RESUMED, friction(None, 0.5), keeps(force_n=5.0), change=before_friction)],
    ),
    # a tare that may be wrong is not used, and the reason is reported; the others are used where they may be
    **{
        f"a state with another {what} is not used": (
            "held",
            [
                restart(
                    *RESUMED, zero(None), said("is not used: ", stream),
                    zero("stored", 1, "right.pad") if alone else zero("config", 0, "right.pad"), change=changed,
                )
            ],
        )
        for what, stream, alone, changed in (
            ("device", "left.wrench", True, set_of("tares", "left.wrench", opened="opened another")),
            ("config", "left.wrench", True, set_of("tares", "left.wrench", basis="0" * 12)),
            ("size", "left.wrench", True, lambda state: state["tares"]["left.wrench"]["offset"].pop()),
            ("gravity", "left.wrench", True, set_of("tares", "left.wrench", gravity_mps2=[0.0])),
            ("temperature", "left.wrench", True, set_of("tares", "left.wrench", temperature_c=14.9)),
            ("age", "left.wrench", False, set_of(kept_wall_ns=WALL_NS - 3600 * SECOND)),
            ("future", "left.wrench", False, set_of(kept_wall_ns=WALL_NS + 3600 * SECOND)),
            ("version", "", False, set_of(version=2)),
            ("rig", "", False, set_of(rig="0" * 12)),
            ("kind of number", "", False, set_of("tares", "left.wrench", offset=["1"] * 6)),
            ("key", "", False, set_of(more=1)),
        )
    },
    **{
        f"after a state that is {what} no finger is believed": (
            "held",
            [restart(*RESUMED, zero(None), said("is not used: ", ""), level(*UNKNOWN), damage=damaged)],
        )
        for what, damaged in (
            ("truncated", lambda text: text[:-9]),
            ("empty", lambda text: ""),
            ("another in one bit", lambda text: text.replace('"id": 1', '"id": 3')),
            ("not a number", lambda text: seal(text.partition(" ")[2].replace("[0.0", "[NaN"))),
        )
    },
    "without a state no finger is believed": (
        "held", [lambda before: follow(begin_beside(before), [*RESUMED, zero(None), level(*UNKNOWN)])],
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", COURSES)
def test_F6_A10_a_course_with_a_restart(name: str) -> None:
    kind, steps = COURSES[name]
    follow(copy.deepcopy(begun(kind)), steps)


def test_a_recording_that_begins_during_a_run_begins_with_its_state() -> None:
    run = copy.deepcopy(begun("held"))
    assert run.refusal("record.start") is None
    [first, *_] = run.engine.kept.first_events(run.t_ns)
    assert isinstance(first, StateRestored)
    again = Engine(config.parse(RIG, "rig.toml"), boot=BOOT, wall_minus_monotonic_ns=WALL_NS)
    for event in (first, LinkUp("right.pad", "opened right.pad")):
        again.handle(event, run.t_ns + 7200 * SECOND)
    assert again.kept.text(run.t_ns) == first.text, "a tare of this run has no limit of age"
