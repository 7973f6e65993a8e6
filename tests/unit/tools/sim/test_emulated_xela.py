from __future__ import annotations

import numpy as np
import pytest

from slipd.devices.xela import Decoder
from slipd.tools.sim.emulated_xela import BEGAN_S, N_PER_COUNT, RATE_HZ, REST_COUNTS, TAXELS, make

S = 1_000_000_000
LOAD = np.arange(3.0 * TAXELS).reshape(TAXELS, 3) * 100 - 2000


@pytest.mark.parametrize(("calibrated", "expected"), [(False, REST_COUNTS + LOAD), (True, N_PER_COUNT * LOAD)])
def test_two_pads_come_at_the_rate_with_the_servers_time(calibrated: bool, expected: np.ndarray) -> None:
    emulator = make(1)
    emulator.opened(0)
    emulator.press(LOAD)
    decoder = Decoder(calibrated)
    samples = [sample for data in emulator.advance(S) for sample in decoder.receive(data, 0)]
    assert len(samples) == 2 * RATE_HZ
    assert {sample.source for sample in samples} == {"1", "2"}
    scale = N_PER_COUNT if calibrated else 1.0
    assert np.mean([sample.values for sample in samples], axis=0) == pytest.approx(expected, abs=2 * scale)
    assert samples[-1].device_time_ns == pytest.approx((BEGAN_S + 1) * 1e9, abs=1000)
    assert (decoder.health.bad, decoder.health.bad_bytes, decoder.health.lost) == (0, 0, 0)


def test_each_client_is_welcomed_and_its_messages_are_ignored() -> None:
    emulator = make(1)
    assert b"Welcome" not in b"".join(emulator.advance(S // 10))
    emulator.opened(S // 10)
    assert emulator.receive(b"hello", S // 10) == []
    assert b"Welcome" in emulator.advance(S // 5)[0]
    assert b"Welcome" not in emulator.advance(S // 4)[0]
