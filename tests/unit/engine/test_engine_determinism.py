"""The engine on any bytes: the same events give the same messages, and garbage gives none."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from engine_rig import BOOT, GRIPPER, LEFT, MS, RIGHT, T0, WALL_NS, Run
from hypothesis import given, settings
from hypothesis import strategies as st

from slipd import config
from slipd.devices import bota, pvdf, xela
from slipd.engine.engine import Engine
from slipd.events import Bytes, Event, LinkDown, LinkUp, Output, Publish, Request, Tick
from slipd_client.messages import encode

LINKS = ("left.wrench", "left.pad", "right.pad", "gripper")


@pytest.mark.parametrize("split", [1, 7, 36, 37, 38, 1000])
def test_verdicts_do_not_depend_on_how_bytes_are_split_into_reads(split: int) -> None:
    data = b"".join(bota.encode_frame((0.1 * k, 0.0, -10.0), (0.0, 0.0, 0.0), 1000 * k) for k in range(50))
    levels = []
    for size in (len(data), split):
        run = Run(LEFT + "[rates]\nslip_hz = 1e6\n")
        run.image()
        for at in range(0, len(data), size):
            run.feed(Bytes("left.wrench", data[at : at + size]))
        levels.append([str((body["level"], body["tangential_n"])) for body in run.published("slip.left")])
    assert len(levels[0]) > 1
    assert levels[0][-1] == levels[1][-1]
    assert set(levels[0]) <= set(levels[1])


def story() -> list[tuple[int, Event]]:
    """Events of every kind."""
    now, rng = T0, np.random.default_rng(3)
    events: list[tuple[int, Event]] = [(now, LinkUp(link, link)) for link in LINKS]
    for k in range(400):
        now += MS
        pull = 0.02 * k + rng.normal() * 0.05
        frame = bota.encode_frame((pull, 0.0, -10.0), (0.01, 0.0, 0.0005 * k), now // 1000, status=int(k == 77) * 2)
        happens: list[Event] = [Bytes("left.wrench", frame if k % 50 else frame[:20] + b"\xaa" * 9)]
        if k % 5 == 0:
            counts = rng.integers(0, 200, (4, 4))
            happens += [Tick(suspended_ns=(k > 300) * 10**10)]
            happens += [Bytes("left.pad", pvdf.encode_scan(counts, k // 5, now / 1000, 5.0))]
        if k % 10 == 0:
            skin = {"2": rng.integers(900, 4000, (4, 3))}
            happens += [Bytes("right.pad", xela.encode_message(k // 10, skin, 1.7e9))]
        if k % 40 == 0:
            body = {"v": 1, "id": k, "op": "lease.acquire", "boot": BOOT, "deadline_ns": now + MS, "ttl_ms": 50}
            happens += [Request(b"ann", body), Request(b"ben", {"op": "status", "v": 1, "id": "s"})]
        events += [(now, event) for event in happens]
    return [*events, (now, LinkDown("left.wrench", "unplugged"))]


def link_of(event: Event) -> str:
    return str(getattr(event, "link", "gripper" if isinstance(event, Request) else "left.pad"))


def outputs(text: str, **identity: Any) -> list[Output]:
    """Return what the story gives on a rig; what links send that it does not have is left out, or clients of those."""
    engine = Engine(config.parse(text, "rig.toml"), **{"boot": BOOT, "wall_minus_monotonic_ns": WALL_NS} | identity)
    known = [(t_ns, event) for t_ns, event in story() if link_of(event) in engine.links]
    return [output for t_ns, event in known for output in engine.handle(event, t_ns)]


def test_the_same_events_give_the_same_outputs_and_boot_and_wall_clock_change_nothing_else() -> None:
    runs = [outputs(LEFT + RIGHT + GRIPPER) for _ in range(2)]
    assert len(runs[0]) > 300
    wires = [[encode(out.body) if isinstance(out, Publish) else repr(out) for out in run] for run in runs]
    assert wires[0] == wires[1]
    others = outputs(LEFT + RIGHT), outputs(LEFT + RIGHT, boot="other", wall_minus_monotonic_ns=10**18)
    bodies = [[out.body | {"boot": "", "timestamp": 0.0} for out in run if isinstance(out, Publish)] for run in others]
    assert bodies[0] == bodies[1]


@pytest.mark.no_cover
@given(
    values=st.lists(
        st.tuples(*[st.floats(width=32)] * 6, st.integers(0, 15), st.booleans(), st.integers(0, 16)), max_size=12
    )
)
@settings(max_examples=60, deadline=None)
def test_no_reading_of_a_force_sensor_breaks_a_message(values: list[tuple[Any, ...]]) -> None:
    """Every 32-bit float and status, on full, partial and empty images; `feed` checks everything that is published."""
    run = Run(LEFT)
    run.up()
    for *wrench, status, fresh, active in values:
        if fresh:
            run.image(np.where(np.arange(16) < active, 100, 0).reshape(4, 4))
        run.wait(1)
        run.feed(Bytes("left.wrench", bota.encode_frame(wrench[:3], wrench[3:], run.t_ns // 1000, status=status)))
    for body in run.published("slip.left"):
        assert body["level"] not in ("stable", "no_contact") or body["normal_n"] is not None


@pytest.mark.no_cover
@given(chunks=st.lists(st.tuples(st.sampled_from(LINKS), st.binary(max_size=200)), max_size=20))
@settings(max_examples=60, deadline=None)
def test_garbage_on_any_line_gives_no_message_and_good_frames_follow(chunks: list[tuple[str, bytes]]) -> None:
    run = Run(LEFT + RIGHT + GRIPPER)
    run.up()
    for link, data in chunks:
        run.feed(Bytes(link, data))
    run.tick()
    assert run.published("slip.left") == []
    run.image()
    run.wrench(0.0)
    run.wrench(0.0)
    assert run.level()[0] == "no_contact", "the next good frames are decoded"
