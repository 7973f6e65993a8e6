"""Pads that measure the force themselves show that the object turns or slides: raw counts through the whole engine."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from operator import itemgetter
from typing import Any

import numpy as np
import pytest
from project import CONFIG

from slipd import config
from slipd.engine.engine import Engine
from slipd.events import Bytes, LinkUp, Publish, Tick
from slipd.tools.sim.emulated_pads import encode_message
from slipd.tools.sim.unkind import SensorClock, UnkindPad
from slipd.types.arrays import Array

START_NS = 1_000_000_000
PERIOD_NS, MS = 100_000_000, 1_000_000
TEXT = (CONFIG / "grips.toml").read_text(encoding="utf-8")
GRID = np.stack(np.meshgrid(np.arange(4.0) - 1.5, np.arange(4.0) - 1.5), axis=-1).reshape(16, 2)
"""Centres of the taxels in pitches, in scan order."""


def zero_of(sensor: str, text: str) -> Array:
    """Return the reading of a pad without load, counts, shape (48,)."""
    pads = config.parse(text, "test").finger
    return np.ravel(next(finger.pad.tare for finger in pads.values() if finger.pad and finger.pad.sensor == sensor))


def counts(sensor: str, text: str, *, total: float, spin: float, edge: float) -> Array:
    """Return the counts of a pad of which the object covers all but what lies beyond ``edge`` pitches along x.

    Args:
        sensor: "1" or "2"; the second carries the opposite spin.
        text: Config with the zero of the pads.
        total: Normal load, counts.
        spin: Spin over (normal load × mean lever).
        edge: Place of the object's edge.
    """
    zero = zero_of(sensor, text)
    share = np.clip(edge - GRID[:, 0] + 0.5, 0.0, 1.0)
    share = share / share.sum()
    arm = GRID - share @ GRID
    lever = np.hypot(*arm.T)
    sense = 1.0 if sensor == "1" else -1.0
    shear = sense * spin * total * (share / np.where(lever > 0.0, lever, 1.0))[:, None]
    shear = shear * np.column_stack([-arm[:, 1], arm[:, 0]])
    return np.asarray((np.reshape(zero, (16, 3)) + np.column_stack([shear, total * share])).ravel().round())


Clock = Callable[[int, str], int]
"""Returns how much later than the server's k-th image a sensor measures it, ns."""

IMAGE_NS = PERIOD_NS // 4
"""The server sends each reading four times."""


def one_clock(image: int, sensor: str) -> int:
    """Let both sensors measure at one time, as no real ones do."""
    return 0


def own_clocks(seed: int) -> Clock:
    """Give each sensor a clock of its own, with an offset of up to 5 ms, a drift of up to 1 %, and jitter."""
    rng = np.random.default_rng(seed)
    clocks = {sensor: SensorClock(rng) for sensor in "12"}
    return lambda image, sensor: min(clocks[sensor].age_ns(image * IMAGE_NS, IMAGE_NS - 2 * MS), IMAGE_NS - MS)


def run(
    looks: list[dict[str, float]], text: str = TEXT, clock: Clock | None = None, *, ideal: bool = False
) -> Iterator[tuple[int, Any]]:
    """Yield the changes of level with the look at which they came, of a grasp that gives these looks.

    Args:
        looks: What `counts` takes, ten a second.
        text: Config.
        clock: Of the sensors; None: each has its own.
        ideal: Whether the taxels read the load as it is; else they are as unkind as real ones.
    """
    clock = clock or own_clocks(0)
    settings = config.parse(text, "test")
    engine = Engine(settings, boot="test", wall_minus_monotonic_ns=0)
    (link,) = engine.links.values()
    engine.handle(LinkUp(link.name, link.address), START_NS)
    engine.handle(Bytes(link.name, b'{"message":"Welcome"}'), START_NS)
    rng = np.random.default_rng(3)
    taxels = {sensor: UnkindPad(rng, zero_of(sensor, text).reshape(16, 3), cols=4) for sensor in "12"}
    for k, look in enumerate(looks):
        pads = {}
        for sensor, pad in taxels.items():
            pad.load = counts(sensor, text, **look).reshape(16, 3)
            read = (pad.load if ideal else pad.reading(PERIOD_NS * 1e-9)).ravel() + rng.normal(0.0, 2.0, 48)
            pads[sensor] = np.clip(read.round(), 0, 65535).astype(np.uint16)
        outputs = []
        for image in range(4 * k, 4 * k + 4):
            at_ns = START_NS + image * IMAGE_NS
            messages = (
                [(at_ns, pads)]
                if clock is one_clock
                else sorted(((at_ns + clock(image, s), {s: pads[s]}) for s in "12"), key=itemgetter(0))
            )
            for at, (t_ns, sent) in enumerate(messages):
                message = encode_message(2 * image + at, sent, t_ns / 1e9)
                outputs += engine.handle(Bytes(link.name, message), t_ns)
            outputs += engine.handle(Tick(), at_ns + PERIOD_NS // 5)
        for output in outputs:
            if isinstance(output, Publish) and output.topic == "warning":
                yield k, output.body


def hold(spin: float = 0.02, edge: float = 1.0, total: float = 20_000.0) -> dict[str, float]:
    return {"total": total, "spin": spin, "edge": edge}


def slips(
    looks: list[dict[str, float]], text: str = TEXT, clock: Clock | None = None, *, ideal: bool = False
) -> list[tuple[int, str, list[str]]]:
    """Return look, finger and evidence of every report of slip."""
    told = run(looks, text, clock, ideal=ideal)
    return [(k, body["finger"], body["evidence"]) for k, body in told if body["level"] == "slipping"]


SWING = [hold(0.05), hold(0.07, 0.97), hold(0.08, 0.85), hold(0.08, 0.6), hold(0.08, 0.3)]


STILL = [hold()] * 20
CLOSING = [hold(0.01, 0.5 + 0.05 * k, 4_000.0 * 1.2**k) for k in range(10)]
OPENING = [hold(0.01, 0.95 - 0.05 * k, 20_000.0 * 0.8**k) for k in range(6)]
SHAKEN = [hold(0.06 * np.sin(0.7 * k), 1.0 + 0.01 * np.sin(0.7 * k)) for k in range(60)]
WITHOUT_MU = "\n".join(line for line in TEXT.splitlines() if not line.startswith("mu"))


def drifting(offset_ns: int) -> Clock:
    """Return clocks of which one moves past the other; then one of its images is never sent."""
    return lambda image, s: (s == "2") * (offset_ns + image * IMAGE_NS // 100) % (IMAGE_NS - MS)


@pytest.mark.parametrize(
    ("looks", "how", "soon"),
    [
        # a box that swings is reported as it begins, a little later without a known coefficient
        (STILL + SWING, {"ideal": True}, (21, 22)),
        (STILL + SWING, {}, (22, 23)),
        *((STILL + SWING, {"ideal": True, "clock": drifting(n)}, (21, 22)) for n in (20_000, 12 * MS)),
        (
            [*STILL, hold(0.07, 0.97), hold(0.08, 0.85), hold(0.08, 0.5), hold(0.08, 0.0)], {"text": WITHOUT_MU},
            (22, 23),
        ),
        # a grip that closes or opens, an arm that shakes a held box, and a pad that is still, whatever mu is stated
        (CLOSING + [hold(0.01, 1.0, 20_700.0)] * 10 + OPENING, {}, ()),
        (SHAKEN, {}, ()),
        *(
            ([hold(0.1)] * 40, {"ideal": True, "text": TEXT.replace("mu_rotation = 0.083", f"mu_rotation = {mu}")}, ())
            for mu in (0.01, 0.09)
        ),
    ],
)  # fmt: skip
def test_a_motion_is_reported_on_both_fingers_as_it_begins_and_nothing_else_is(
    looks: list[dict[str, float]], how: dict[str, Any], soon: tuple[int, ...]
) -> None:
    found = slips(looks, **how)
    assert found[:1] == [] if not soon else found[0][0] in soon
    assert {finger for _k, finger, _evidence in found} == ({"left", "right"} if soon else set())
    assert all(evidence == ["image_change"] for _k, _finger, evidence in found)


def test_sensors_with_clocks_of_their_own_report_the_same() -> None:
    assert slips(STILL + SWING, clock=own_clocks(1)) == slips(STILL + SWING, clock=one_clock)


def test_the_slip_ends_when_the_motion_ends() -> None:
    looks = [*STILL, hold(0.08, 0.85), hold(0.08, 0.6), *[hold(0.04, 0.6)] * 10]
    levels = [body["level"] for _, body in run(looks) if body["finger"] == "left"]
    assert "slipping" in levels
    assert levels[-1] != "slipping"


def test_a_box_that_turned_is_warned_of_before_it_turns_again() -> None:
    swing = [hold(0.05), hold(0.07, 0.97), hold(0.08, 0.85), hold(0.08, 0.6)]
    again = [hold(0.03, 0.6)] * 20 + [hold(0.03 + 0.01 * k, 0.6) for k in range(5)]
    told = [(k, body["level"], body["reasons"]) for k, body in run([hold()] * 20 + swing + again)]
    began = len(swing) + 20
    assert {level for k, level, _ in told if k < 21} <= {"stable"}, "nothing is known of its friction yet"
    assert told[-1][1:] == ("warning", ["rotation"])
    assert told[-1][0] > began + 20, "it swings back first, and then is near the spin at which it turned"
    no_turn = [(k, body["level"]) for k, body in run([hold(edge=0.6)] * 20 + again)]
    assert {level for _, level in no_turn} <= {"stable"}
