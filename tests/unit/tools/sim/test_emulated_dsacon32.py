import numpy as np
import pytest

from slipd.devices import dsacon32
from slipd.tools.sim.emulated_dsacon32 import Dsacon32
from slipd.tools.sim.emulators import make_emulator

MS = 1_000_000
S = 1_000 * MS


def controller(**options):
    return Dsacon32([(4, 2), (2, 2)], np.random.default_rng(1), **options)


def images(made, begin_ns, end_ns, step_ns=MS):
    said = b"".join(piece for t in range(begin_ns, end_ns, step_ns) for piece in made.advance(t))
    return dsacon32.Decoder().receive(said, 0)


def test_it_pushes_images_at_the_requested_rate_of_its_own_clock():
    made = controller(noise_counts=0.0, clock_ppm=1000.0)
    made.press(np.arange(12) * 500)
    assert made.advance(S) == []
    assert made.receive(dsacon32.acquire(25, rle=True), S) == [dsacon32.encode_error(dsacon32.ACQUIRE)]
    samples = images(made, S, 3 * S)
    assert len(samples) == 49
    assert samples[0].values.tolist() == [min(500 * cell, 4095) for cell in range(12)]
    assert np.diff([sample.device_time_ns for sample in samples]).mean() / MS == pytest.approx(40.04, abs=0.03)
    made.receive(dsacon32.acquire(0, rle=True), 3 * S)
    assert made.advance(5 * S) == []


@pytest.mark.parametrize("rle", [False, True])
def test_images_come_plain_or_run_length_encoded_as_asked(rle):
    made = controller(noise_counts=0.0)
    made.receive(dsacon32.acquire(30, rle=rle), 0)
    (said,) = made.advance(34 * MS)
    assert (said[10], len(said)) == ((1, 15) if rle else (0, 37))


def test_the_daemons_session_starts_the_finger_that_is_made_by_name():
    made = make_emulator("dsacon32", 3)
    made.press(np.full(162, 100.0))
    session, samples = dsacon32.Session(**made.options), []
    due = session.start(0)
    for now_ns in range(0, 2 * S, MS):
        heard = [*made.advance(now_ns), *(made.receive(due, now_ns) if due else [])]
        for piece in heard:
            samples += session.receive(piece, now_ns)
        due = session.on_time(now_ns)
    assert session.state == "running"
    assert {(sample.source, sample.values.size) for sample in samples} == {("0", 84), ("1", 78)}
    assert len(samples) == pytest.approx(2 * 2 * made.rate_hz, abs=4)
    assert session.health.bad_bytes == 0
