"""Both Weiss sessions against their emulated controllers: booting, refusing, silent, disconnected in the middle."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from weiss_bench import MS, Bench, S, both, dsacon_bench, wts_bench

from slipd.devices import dsacon32, wts
from slipd.devices.dsacon32 import BOOT_TEXT
from slipd.devices.shared import weiss_packets as weiss
from slipd.devices.shared.sensor_session import ANSWER_NS
from slipd.tools.sim.emulated_dsacon32 import Dsacon32


class BootingDsacon32(Dsacon32):
    """A controller that was powered up at time 0: it ignores requests for 8 s and sends its boot text."""

    boot_text_ns = (7 * S, 7_400 * MS, 7_800 * MS)

    def receive(self, data: bytes, t_ns: int) -> list[bytes]:
        return super().receive(data, t_ns) if t_ns >= 8 * S else []

    def advance(self, t_ns: int) -> list[bytes]:
        text = [BOOT_TEXT] * self.boot_text_ns.count(t_ns)
        return text + super().advance(t_ns)


DSACON_ASKED = [
    dsacon32.encode_query(dsacon32.CONTROLLER),
    dsacon32.encode_query(dsacon32.SENSOR),
    dsacon32.encode_matrix_query(0),
    dsacon32.encode_matrix_query(1),
    dsacon32.acquire(0, rle=True),
    dsacon32.acquire(30, rle=True),
]
WTS_ASKED = [
    wts.encode_query(wts.SYSTEM),
    wts.encode_query(wts.MATRIX),
    wts.encode_query(wts.STOP),
    wts.encode_start(10),
]


@pytest.mark.parametrize(
    ("make", "asked", "identity", "rate_hz"),
    [(dsacon_bench, DSACON_ASKED, "S/N 1234", 60), (wts_bench, WTS_ASKED, "S/N 4711", 100)],
)
def test_the_device_is_queried_and_started(
    make: Callable[[], Bench], asked: list[bytes], identity: str, rate_hz: int
) -> None:
    bench = make()
    assert bench.session.identity == ""
    bench.start()
    bench.run(2)
    assert bench.written == asked
    assert bench.states == ["waiting", "configuring", "waiting for images", "running"]
    assert bench.session.identity == identity
    assert len(bench.samples) == pytest.approx(2 * rate_hz, abs=4)
    assert bench.session.health.bad_bytes == 0


def test_the_reported_matrices_split_the_images() -> None:
    bench = dsacon_bench()
    bench.start()
    bench.run(0.2)
    assert [(sample.source, sample.values.tolist()) for sample in bench.samples[:2]] == [
        ("0", list(range(8))),
        ("1", list(range(8, 12))),
    ]
    bench.deliver(dsacon32.encode_frame([1] * 11, 0))
    assert bench.samples[-1].values.tolist() == [8, 9, 10, 11]
    assert bench.session.health.bad_bytes > 0


def test_matrices_take_effect_when_all_are_known() -> None:
    bench = dsacon_bench()
    bench.mend = lambda answer: b"" if len(bench.written) == 4 else answer
    bench.start()
    bench.run(0.1)
    assert bench.written == DSACON_ASKED[:4]
    bench.deliver(dsacon32.encode_frame(range(12), 0))
    assert [len(sample.values) for sample in bench.samples] == [12]


def test_options_reach_the_requests() -> None:
    bench = Bench(dsacon32.Session(rate_hz=1, rle=False), dsacon_bench().device)
    bench.start()
    bench.run(4.5)
    assert bench.written[-2:] == [dsacon32.acquire(0, rle=False), dsacon32.acquire(1, rle=False)]
    assert bench.session.stop() == dsacon32.acquire(0, rle=False)
    assert len(bench.samples) == 8  # a pause of a second is not silence at this rate
    session = wts.Session(interval_ms=0)
    bench = Bench(session, wts_bench().device)
    bench.start()
    bench.run(0.1)
    assert bench.written[-1] == wts.encode_start(0)


@pytest.mark.parametrize("rate_hz", [0, 31, 2.5])
def test_a_rate_beyond_the_controller_is_refused(rate_hz: int) -> None:
    with pytest.raises(ValueError, match="1 to 30"):
        dsacon32.Session(rate_hz=rate_hz)


@pytest.mark.parametrize("interval_ms", [-1, 65_536, 2.5])
def test_an_interval_that_cannot_be_sent_is_refused(interval_ms: int) -> None:
    with pytest.raises(ValueError, match="0 to 65535"):
        wts.Session(interval_ms=interval_ms)


def test_D1_a_booting_controller_is_awaited_without_an_error() -> None:
    device = BootingDsacon32([(4, 2), (2, 2)], np.random.default_rng(0))
    bench = Bench(dsacon32.Session(), device)
    bench.start()
    bench.run(7.9)
    assert bench.states == ["waiting"]
    assert bench.samples == []
    bench.run(1)
    assert bench.states == ["waiting", "configuring", "waiting for images", "running"]
    assert bench.session.health.bad_bytes == 0


@both
def test_a_device_that_never_answers_is_reported_and_retried_forever(make: Callable[[], Bench]) -> None:
    bench = make()
    bench.mend = lambda _: b""
    bench.start()
    bench.run(12)
    assert bench.states[0] == "waiting"
    assert bench.session.state in {"no answer to controller", "no answer to system information"}
    assert set(bench.written) == {bench.written[0]}
    assert len(bench.written) >= 20
    bench.mend = bytes
    bench.run(2)
    assert bench.session.state == "running"


@both
def test_an_unanswered_later_query_is_repeated_and_then_the_sequence_restarts(make: Callable[[], Bench]) -> None:
    bench = make()
    bench.mend = lambda answer: b"" if bench.written[1:2] == bench.written[-1:] else answer
    bench.start()
    bench.run(1.4)
    first, second = bench.written[:2]
    assert bench.written == [first, second, second, second]
    bench.run(0.5)
    assert bench.written[4:6] == [first, second]
    bench.run(1)
    assert any(state.startswith("no answer to") for state in bench.states)
    bench.mend = bytes
    bench.run(2)
    assert bench.session.state == "running"


@both
def test_a_repeated_answer_is_not_mistaken_for_the_next_one(make: Callable[[], Bench]) -> None:
    bench = make()
    bench.start()
    bench.mend = lambda answer: b""
    bench.run(0.1)
    bench.mend = lambda answer: answer + answer
    bench.run(0.6)
    assert len(bench.written) == 3  # after a repeated query the next one waits
    bench.run(1)
    assert bench.session.state == "running"
    assert len(set(bench.written)) == len(DSACON_ASKED if make is dsacon_bench else WTS_ASKED)


def test_a_late_second_answer_about_a_matrix_is_not_mistaken_for_the_next_matrix() -> None:
    bench = dsacon_bench()
    late = dsacon32.encode_matrix(4, 2)
    bench.mend = lambda answer: b"" if bench.written.count(DSACON_ASKED[2]) == 1 and answer[3] == 0x0B else answer
    bench.start()
    bench.run(0.6)
    bench.deliver(late)
    bench.run(1)
    assert bench.session.state == "running"
    assert [len(sample.values) for sample in bench.samples[:2]] == [8, 4]


@both
def test_images_of_a_device_that_already_runs_are_returned_during_the_queries(make: Callable[[], Bench]) -> None:
    before = make()
    before.start()
    before.run(0.5)
    bench = Bench(make().session, before.device, now_ns=before.now_ns, mend=lambda _: b"")
    bench.start()
    bench.run(1)
    assert bench.session.state == "waiting"
    assert len(bench.samples) >= 29
    bench.mend = bytes
    bench.run(2)
    assert bench.session.state == "running"


@both
def test_silence_while_running_is_reported_after_a_second_and_the_sequence_restarts(make: Callable[[], Bench]) -> None:
    bench = make()
    bench.start()
    bench.run(0.5)
    asked = list(bench.written)
    bench.device._push(None, bench.now_ns)
    bench.run(0.9)
    assert bench.session.state == "running"
    bench.run(1)
    assert bench.written == asked * 2
    assert bench.session.state == "running"


def test_half_an_image_and_then_a_pause_does_not_swallow_the_answer() -> None:
    bench = dsacon_bench()
    bench.mend = lambda _: b""
    bench.start()
    bench.run(0.1)
    partial = weiss.PREAMBLE + b"\0\xa5\x0f" + bytes(4) + b"\1"
    bench.deliver(partial)
    bench.mend = bytes
    bench.run(2)
    assert bench.session.state == "running"
    assert bench.session.health.bad_bytes == len(partial)


@both
def test_a_partial_image_and_the_identity_of_the_previous_link_are_dropped(make: Callable[[], Bench]) -> None:
    bench = make()
    bench.start()
    bench.run(0.5)
    assert bench.session.identity
    bench.session.stop()
    bench.deliver(weiss.PREAMBLE + b"\0")
    bench.session.start(bench.now_ns)
    assert bench.session.identity == ""
    assert bench.session.health.bad_bytes == 4


def test_another_controller_on_the_line_has_its_own_matrices() -> None:
    bench = dsacon_bench()
    bench.start()
    bench.run(0.5)
    bench.device = Dsacon32([(3, 3)], np.random.default_rng(0))
    bench.samples.clear()
    bench.run(2)
    assert {(sample.source, len(sample.values)) for sample in bench.samples} == {("0", 9)}


def test_a_long_interval_is_not_silence() -> None:
    bench = Bench(wts.Session(interval_ms=2000), wts_bench().device)
    bench.start()
    bench.run(7)
    assert len(bench.written) == 4
    assert len(bench.samples) == 3


@both
def test_stop_ends_the_images_and_the_deadlines(make: Callable[[], Bench]) -> None:
    bench = make()
    assert (bench.session.state, bench.session.next_deadline()) == ("closed", None)
    bench.start()
    bench.run(0.5)
    bench.write(bench.session.stop())
    bench.samples.clear()
    bench.run(1)
    assert (bench.session.state, bench.session.next_deadline()) == ("closed", None)
    assert bench.samples == []
    assert bench.session.on_time(10**12) == b""
    bench.device._push(10 * MS, bench.now_ns)
    bench.run(0.1)
    assert bench.samples
    assert bench.session.state == "closed"


def test_no_query_is_sent_before_it_is_due() -> None:
    session = wts.Session()
    assert session.start(5) == wts.encode_query(wts.SYSTEM)
    assert session.next_deadline() == 5 + ANSWER_NS
    assert session.on_time(6) == b""
