"""What is special of the sessions with Weiss controllers: matrices, refusals in words, and answers that make no sense.

What they share with all sessions: test_every_session.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from session_bench import Bench, bench_of, nothing

from slipd.devices import dsacon32, wts
from slipd.devices.dsacon32 import BOOT_TEXT
from slipd.devices.shared import weiss_packets as weiss
from slipd.tools.sim import emulated_weiss as sim
from slipd.tools.sim.emulated_weiss import Dsacon32

ASKED = [
    dsacon32.encode_query(dsacon32.CONTROLLER),
    dsacon32.encode_query(dsacon32.SENSOR),
    dsacon32.encode_query(dsacon32.MATRIX, b"\0"),
    dsacon32.encode_query(dsacon32.MATRIX, b"\1"),
]


def dsacon(**options: Any) -> Bench:
    """Return a bench of a controller with two small matrices, whose cells count up."""
    device = Dsacon32(0, [(4, 2), (2, 2)], noise_counts=0.0)
    device.press(np.arange(12))
    return Bench(dsacon32.Session(**options), device)


def made(name: str) -> Bench:
    return dsacon() if name == "dsacon32" else bench_of(name)


def sizes(bench: Bench) -> list[tuple[str, int]]:
    return [(sample.source, len(sample.values)) for sample in bench.samples]


def test_the_reported_matrices_split_the_images_and_another_controller_has_its_own() -> None:
    bench = dsacon().start(0.2)
    assert [(sample.source, sample.values.tolist()) for sample in bench.samples[:2]] == [
        ("0", list(range(8))),
        ("1", list(range(8, 12))),
    ]
    bench.deliver(sim.encode_frame([1] * 11, 0))
    assert bench.samples[-1].values.tolist() == [8, 9, 10, 11]
    assert bench.session.health.bad_bytes > 0
    bench.device = Dsacon32(0, [(3, 3)])
    bench.samples.clear()
    assert {*sizes(bench.run(2))} == {("0", 9)}


def test_matrices_take_effect_when_all_are_known() -> None:
    bench = dsacon()
    bench.told = lambda answer: b"" if len(bench.written) == 4 else answer
    bench.start(0.1)
    bench.deliver(sim.encode_error(dsacon32.ACQUIRE))
    assert bench.written == ASKED, "the answer to something else"
    bench.deliver(sim.encode_frame(range(12), 0))
    assert sizes(bench) == [("0", 12)]


def test_a_late_second_answer_about_a_matrix_is_not_mistaken_for_the_next_matrix() -> None:
    bench = dsacon()
    bench.told = lambda answer: b"" if bench.written.count(ASKED[2]) == 1 and answer[3] == 0x0B else answer
    bench.start(0.6)
    bench.deliver(sim.encode_matrix(4, 2))
    assert bench.run(1).session.state == "running"
    assert sizes(bench)[:2] == [("0", 8), ("1", 4)]


def test_options_reach_the_requests_and_a_long_interval_is_not_silence() -> None:
    bench = dsacon(rate_hz=1, rle=False).start(4.5)
    assert bench.written[-2:] == [dsacon32.acquire(0, rle=False), dsacon32.acquire(1, rle=False)]
    assert bench.session.next_deadline() == bench.samples[-1].t_ns + 3_000_000_000
    assert bench.session.stop() == dsacon32.acquire(0, rle=False)
    assert len(bench.samples) == 8


@pytest.mark.parametrize(("interval_ms", "count"), [(0, 1745), (2000, 3)])
def test_a_module_sends_at_its_interval(interval_ms: int, count: int) -> None:
    module = bench_of("wts", interval_ms=interval_ms).start(7)
    assert (len(module.written), module.written[-1]) == (4, wts.encode_start(interval_ms))
    assert len(module.samples) == pytest.approx(count, abs=10)


def test_D1_a_booting_controller_is_awaited_without_an_error() -> None:
    bench = dsacon()
    bench.heard = nothing
    bench.start(7.9)
    bench.deliver(BOOT_TEXT * 3)
    assert (bench.states, bench.samples) == (["waiting"], [])
    bench.heard = bytes
    assert bench.run(1).states == ["waiting", "configuring", "waiting for images", "running"]
    assert bench.session.health.bad_bytes == 0


def test_half_an_image_and_then_a_pause_does_not_swallow_the_answer() -> None:
    bench = dsacon()
    bench.told = nothing
    bench.start(0.1)
    partial = weiss.PREAMBLE + b"\0\xa5\x0f" + bytes(4) + b"\1"
    bench.deliver(partial)
    bench.told = bytes
    assert bench.run(2).session.state == "running"
    assert bench.session.health.bad_bytes == len(partial)


@pytest.mark.parametrize(
    ("name", "packet_id", "wrong", "state"),
    [
        ("dsacon32", 0x01, sim.encode_error(0x01, 15), "refused controller: access denied"),
        ("dsacon32", 0x02, sim.encode_error(0x02, 12), "refused sensor: not enough parameters"),
        ("dsacon32", 0x02, sim.encode_sensor(6, 1, error=2), "refused sensor: no sensor"),
        ("dsacon32", 0x0B, sim.encode_error(0x0B), "empty answer to matrix 0"),
        ("dsacon32", 0x03, sim.encode_error(0x03, 27), "refused start: range error"),
        (
            "dsacon32",
            0x01,
            sim.encode_controller(5, kind=0),
            "the controller must be a DSACON32, got type DSACON16",
        ),
        (
            "dsacon32",
            0x01,
            sim.encode_controller(5, kind=9),
            "the controller must be a DSACON32, got type 9",
        ),
        ("dsacon32", 0x01, sim.encode_controller(5, operable=False), "controller not operable"),
        ("dsacon32", 0x02, sim.encode_sensor(0, 1), "a controller must have 1 to 16 matrices, got 0"),
        ("dsacon32", 0x02, sim.encode_sensor(17, 1), "a controller must have 1 to 16 matrices, got 17"),
        ("dsacon32", 0x0B, sim.encode_matrix(0, 14), "matrix 0 must be columns and rows"),
        (
            "dsacon32",
            0x0B,
            sim.encode_matrix(100, 100),
            "the matrices must have at most 2048 cells, got 10000",
        ),
        ("wts", 0x30, sim.encode_status(0x30, 16), "refused matrix information: access denied"),
        ("wts", 0x30, sim.encode_module(0, 8), "matrix of 0 x 8 cells of 4095"),
        ("wts", 0x30, sim.encode_module(100, 100), "matrix of 100 x 100 cells of 4095"),
        ("wts", 0x30, sim.encode_module(4, 8, 0), "matrix of 4 x 8 cells of 0"),
        ("wts", 0x50, sim.encode_status(0x50), "empty answer to system information"),
        ("wts", 0x21, sim.encode_status(0x21, 12), "refused start: no parameter expected"),
    ],
)
def test_D2_a_refusal_or_a_device_that_cannot_be_read_is_named_asked_again_and_not_started(
    name: str, packet_id: int, wrong: bytes, state: str
) -> None:
    bench = made(name)
    bench.told = lambda answer: wrong if answer[3] == packet_id else answer
    assert bench.start(3).session.state.startswith(state)
    assert bench.written[-1] == bench.written[-2] == bench.written[-3]
    assert packet_id in (0x03, 0x21) or bench.samples == []
    bench.told = bytes
    assert bench.run(2).session.state == "running"


@pytest.mark.parametrize(
    ("name", "asked", "wrong"),
    [
        ("dsacon32", dsacon32.acquire(30, rle=True), sim.encode_error(dsacon32.ACQUIRE, 4)),
        ("wts", wts.encode_start(10), sim.encode_status(wts.START, 4)),
        ("dsacon32", dsacon32.acquire(0, rle=True), sim.encode_error(dsacon32.ACQUIRE, 17)),
        ("wts", wts.encode_query(wts.STOP), sim.encode_status(wts.STOP, 18)),
    ],
)
def test_a_device_that_already_runs_or_has_nothing_to_stop_is_accepted(name: str, asked: bytes, wrong: bytes) -> None:
    bench = made(name)
    bench.told = lambda answer: wrong if bench.written[-1] == asked and answer[3] == wrong[3] else answer
    assert bench.start(1).session.state == "running"
