"""The engine on any bytes: the same events give the same messages, and garbage gives none."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from slipd import config
from slipd.devices import bota, pvdf, xela
from slipd.engine.engine import Engine
from slipd.events import Bytes, Event, LinkDown, LinkUp, Output, Publish, Request, Tick
from slipd_client.messages import encode

MS = 1_000_000
Run = Any


@pytest.mark.parametrize("split", [1, 7, 36, 37, 38, 1000])
def test_verdicts_do_not_depend_on_how_bytes_are_split_into_reads(
    make_run: Callable[[str], Run], left: str, split: int
) -> None:
    data = b"".join(bota.encode_frame((0.1 * k, 0.0, -10.0), (0.0, 0.0, 0.0), 1000 * k) for k in range(50))
    levels = []
    for size in (len(data), split):
        run = make_run(left + "[rates]\nslip_hz = 1e6\n")
        run.image()
        for at in range(0, len(data), size):
            run.feed(Bytes("left.wrench", data[at : at + size]))
        levels.append([(body["level"], body["tangential_n"]) for body in run.published("slip.left")])
    assert len(levels[0]) > 1
    assert levels[0][-1] == levels[1][-1]
    assert set(map(str, levels[0])) <= set(map(str, levels[1]))


def story(left: str, right: str, gripper: str) -> list[tuple[int, Event]]:
    """Events of every kind."""
    now, rng = 100_000_000_000, np.random.default_rng(3)
    links = ("left.wrench", "left.pad", "right.pad", "gripper")
    events: list[tuple[int, Event]] = [(now, LinkUp(link, link)) for link in links]
    for k in range(400):
        now += MS
        pull = 0.02 * k + rng.normal() * 0.05
        frame = bota.encode_frame((pull, 0.0, -10.0), (0.01, 0.0, 0.0005 * k), now // 1000, status=int(k == 77) * 2)
        events.append((now, Bytes("left.wrench", frame if k % 50 else frame[:20] + b"\xaa" * 9)))
        if k % 5 == 0:
            events.append((now, Tick(suspended_ns=(k > 300) * 10**10)))
            counts = rng.integers(0, 200, (4, 4))
            events.append((now, Bytes("left.pad", pvdf.encode_scan(counts, k // 5, now / 1000, 5.0))))
        if k % 10 == 0:
            skin = {"2": rng.integers(900, 4000, (4, 3))}
            events.append((now, Bytes("right.pad", xela.encode_message(k // 10, skin, 1.7e9))))
        if k % 40 == 0:
            body = {"v": 1, "id": k, "op": "lease.acquire", "boot": "b00t", "deadline_ns": now + MS, "ttl_ms": 50}
            events.append((now, Request(b"ann", body)))
            events.append((now, Request(b"ben", {"op": "status", "v": 1, "id": "s"})))
    events.append((now, LinkDown("left.wrench", "unplugged")))
    return events


def test_the_same_events_give_the_same_outputs(left: str, right: str, gripper: str) -> None:
    runs: list[list[Output]] = []
    for _ in range(2):
        rig = config.parse(left + right + gripper, "rig.toml")
        engine = Engine(rig, boot="b00t", wall_minus_monotonic_ns=5)
        runs.append([out for t_ns, event in story(left, right, gripper) for out in engine.handle(event, t_ns)])
    assert len(runs[0]) > 300
    wires = [[encode(out.body) if isinstance(out, Publish) else repr(out) for out in outputs] for outputs in runs]
    assert wires[0] == wires[1]


def test_boot_and_wall_clock_change_nothing_else(left: str, right: str, gripper: str) -> None:
    runs = []
    for boot, wall in (("b00t", 5), ("other", 10**18)):
        engine = Engine(config.parse(left + right, "rig.toml"), boot=boot, wall_minus_monotonic_ns=wall)
        bodies = [
            out.body
            for t_ns, event in story(left, right, gripper)
            if getattr(event, "link", "") != "gripper" and not isinstance(event, Request)
            for out in engine.handle(event, t_ns)
            if isinstance(out, Publish)
        ]
        runs.append([{k: v for k, v in body.items() if k not in ("boot", "timestamp")} for body in bodies])
    assert runs[0] == runs[1]


@pytest.mark.no_cover
@given(
    values=st.lists(
        st.tuples(*[st.floats(width=32)] * 6, st.integers(0, 15), st.booleans(), st.integers(0, 16)), max_size=12
    )
)
@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
def test_no_reading_of_a_force_sensor_breaks_a_message(
    make_run: Callable[[str], Run], left: str, values: list[tuple[Any, ...]]
) -> None:
    """Every 32-bit float and status, on full, partial and empty images; `feed` checks everything that is published."""
    run = make_run(left)
    run.up()
    for *wrench, status, fresh, active in values:
        if fresh:
            counts = np.zeros(16, dtype=int)
            counts[:active] = 100
            run.image(counts.reshape(4, 4))
        run.wait(1)
        run.feed(Bytes("left.wrench", bota.encode_frame(wrench[:3], wrench[3:], run.t_ns // 1000, status=status)))
    for body in run.published("slip.left"):
        if body["level"] in ("stable", "no_contact"):
            assert body["normal_n"] is not None


@pytest.mark.no_cover
@given(
    chunks=st.lists(
        st.tuples(st.sampled_from(("left.wrench", "left.pad", "right.pad", "gripper")), st.binary(max_size=200)),
        max_size=20,
    )
)
@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
def test_garbage_on_any_line_gives_no_message_and_good_frames_follow(
    make_run: Callable[[str], Run], left: str, right: str, gripper: str, chunks: list[tuple[str, bytes]]
) -> None:
    run = make_run(left + right + gripper)
    run.up()
    for link, data in chunks:
        run.feed(Bytes(link, data))
    run.tick()
    assert run.published("slip.left") == []
    run.image()
    run.wrench(0.0)
    run.wrench(0.0)
    assert run.level()[0] == "no_contact", "the next good frames are decoded"
