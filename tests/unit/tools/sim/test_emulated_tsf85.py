from __future__ import annotations

import numpy as np
import pytest
from driving import drive

from slipd.devices import tsf85
from slipd.tools.sim.emulated_tsf85 import FIRMWARE, REST_COUNTS, make

MS = 1_000_000
START, STOP = (tsf85.encode_packet(tsf85.AUTOSEND, bytes((period,))) for period in (1, 0))


def test_the_daemons_session_brings_both_fingers_to_sixty_images_a_second() -> None:
    emulator = make(1)
    pressed = np.arange(28) * 10.0
    emulator.press(pressed)
    session = tsf85.Session(**emulator.options)
    samples = drive(session, emulator, 2.0)
    assert (session.state, session.identity) == ("running", FIRMWARE.decode())
    for source in ("0", "1"):
        mine = [sample for sample in samples if sample.source == source]
        assert len(mine) == pytest.approx(2 * emulator.rate_hz, abs=3)
        assert np.mean([sample.values for sample in mine], axis=0) == pytest.approx(REST_COUNTS + pressed, abs=1.0)
        steps_ns = np.diff([sample.device_time_ns for sample in mine])
        assert steps_ns.mean() == pytest.approx(1e9 / emulator.rate_hz, rel=0.01)


def test_it_sends_a_packet_each_period_until_it_is_stopped() -> None:
    emulator = make(1)
    assert emulator.advance(100 * MS) == []
    emulator.receive(START, 100 * MS)
    packets = emulator.advance(200 * MS)
    assert len(packets) == 100
    assert all(len(packet) > 2 * 57 for packet in packets), "both arrays each millisecond"
    assert len({packet[4:118] for packet in packets}) in (6, 7)
    emulator.receive(STOP, 200 * MS)
    assert emulator.advance(300 * MS) == []
