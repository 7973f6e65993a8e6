"""A Weiss controller that refuses, or answers what makes no sense."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from weiss_bench import Bench, dsacon_bench, of, wts_bench

from slipd.devices import dsacon32, wts


@pytest.mark.parametrize(
    ("make", "packet_id", "wrong", "state"),
    [
        (dsacon_bench, 0x01, dsacon32.encode_error(0x01, 15), "refused controller: access denied"),
        (dsacon_bench, 0x02, dsacon32.encode_error(0x02, 12), "refused sensor: not enough parameters"),
        (dsacon_bench, 0x02, dsacon32.encode_sensor(6, 1, error=2), "refused sensor: no sensor"),
        (dsacon_bench, 0x0B, dsacon32.encode_error(0x0B), "empty answer to matrix 0"),
        (dsacon_bench, 0x03, dsacon32.encode_error(0x03, 27), "refused start: range error"),
        (wts_bench, 0x30, wts.encode_status(0x30, 16), "refused matrix information: access denied"),
        (wts_bench, 0x50, wts.encode_status(0x50), "empty answer to system information"),
        (wts_bench, 0x21, wts.encode_status(0x21, 12), "refused start: no parameter expected"),
    ],
)
def test_a_refusal_is_reported_in_words_and_the_query_repeated(
    make: Callable[[], Bench], packet_id: int, wrong: bytes, state: str
) -> None:
    bench = make()
    bench.mend = of(packet_id, wrong)
    bench.start()
    bench.run(3)
    assert bench.session.state == state
    assert bench.written[-1] == bench.written[-2] == bench.written[-3]
    bench.mend = bytes
    bench.run(2)
    assert bench.session.state == "running"


@pytest.mark.parametrize(
    ("wrong", "state"),
    [
        (
            dsacon32.encode_controller(5, kind=0),
            "the controller must be a DSACON32, got type DSACON16",
        ),
        (
            dsacon32.encode_controller(5, kind=9),
            "the controller must be a DSACON32, got type 9",
        ),
        (dsacon32.encode_controller(5, operable=False), "controller not operable"),
        (dsacon32.encode_sensor(0, 1), "a controller must have 1 to 16 matrices, got 0"),
        (dsacon32.encode_sensor(17, 1), "a controller must have 1 to 16 matrices, got 17"),
        (dsacon32.encode_matrix(0, 14), "matrix 0 must be columns and rows"),
        (dsacon32.encode_matrix(100, 100), "the matrices must have at most 2048 cells, got 10000"),
    ],
)
def test_D2_a_controller_that_cannot_be_read_is_reported_and_not_started(wrong: bytes, state: str) -> None:
    bench = dsacon_bench()
    bench.mend = of(wrong[3], wrong)
    bench.start()
    bench.run(2.5)
    assert bench.session.state.startswith(state)
    assert bench.samples == []
    assert dsacon32.acquire(30, rle=True) not in bench.written
    bench.mend = bytes
    bench.run(2)
    assert bench.session.state == "running"


@pytest.mark.parametrize("matrix", [wts.Matrix(0, 8), wts.Matrix(100, 100), wts.Matrix(4, 8, 0)])
def test_D2_a_module_whose_matrix_makes_no_sense_is_reported_and_not_started(matrix: wts.Matrix) -> None:
    bench = wts_bench()
    bench.mend = of(wts.MATRIX, wts.encode_matrix(matrix))
    bench.start()
    bench.run(1)
    assert bench.session.state.startswith(f"matrix of {matrix.cols} x {matrix.rows} cells of {matrix.full_scale}")
    assert wts.encode_start(10) not in bench.written


@pytest.mark.parametrize(
    ("make", "wrong"),
    [(dsacon_bench, dsacon32.encode_error(dsacon32.ACQUIRE, 4)), (wts_bench, wts.encode_status(wts.START, 4))],
)
def test_a_device_that_already_runs_is_accepted(make: Callable[[], Bench], wrong: bytes) -> None:
    bench = make()
    bench.mend = of(wrong[3], wrong)
    bench.start()
    bench.run(1)
    assert bench.session.state == "running"


@pytest.mark.parametrize(
    ("make", "wrong"),
    [(dsacon_bench, dsacon32.encode_error(dsacon32.ACQUIRE, 17)), (wts_bench, wts.encode_status(wts.STOP, 18))],
)
def test_a_device_that_has_nothing_to_stop_is_started_nevertheless(make: Callable[[], Bench], wrong: bytes) -> None:
    bench = make()
    stop = bench.session.stop()
    bench.mend = lambda answer: wrong if bench.written[-1] == stop else answer
    bench.start()
    bench.run(1)
    assert bench.session.state == "running"
