import numpy as np
import pytest

from slipd.devices import wts
from slipd.tools.sim.emulated_wts import FASTEST_MS, WtsModule
from slipd.tools.sim.emulators import make_emulator

MS = 1_000_000
S = 1_000 * MS


def module(**options):
    return WtsModule(wts.Matrix(2, 3), np.random.default_rng(1), **options)


def images(made, end_ns):
    return wts.Decoder().receive(b"".join(made.advance(end_ns)), 0)


@pytest.mark.parametrize(("asked_ms", "interval_ms"), [(25, 25), (0, FASTEST_MS), (1, FASTEST_MS)])
def test_it_pushes_images_at_the_requested_interval(asked_ms, interval_ms):
    made = module(noise_counts=0.0, clock_ppm=0.0)
    made.press(np.array([0, 1, 2, 300, 5000, -3]))
    assert made.receive(wts.encode_start(asked_ms), 0) == [wts.encode_status(wts.START)]
    samples = images(made, S)
    assert len(samples) == 1000 // interval_ms
    assert samples[0].values.tolist() == [0, 1, 2, 300, 4095, 0]
    assert set(np.diff([sample.device_time_ns for sample in samples])) == {interval_ms * MS}
    assert made.receive(wts.encode_query(wts.STOP), S) == [wts.encode_status(wts.STOP)]
    assert made.advance(2 * S) == []


def test_the_daemons_session_starts_the_module_that_is_made_by_name():
    made = make_emulator("wts", 3)
    made.press(np.full(32, 100.0))
    session, samples = wts.Session(**made.options), []
    due = session.start(0)
    for now_ns in range(0, S, MS):
        heard = [*made.advance(now_ns), *(made.receive(due, now_ns) if due else [])]
        for piece in heard:
            samples += session.receive(piece, now_ns)
        due = session.on_time(now_ns)
    assert session.state == "running"
    assert {sample.values.size for sample in samples} == {32}
    assert len(samples) == pytest.approx(made.rate_hz, abs=3)
    assert session.health.bad_bytes == 0
