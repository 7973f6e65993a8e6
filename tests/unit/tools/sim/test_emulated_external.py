"""The emulated program that pushes readings, and the driver of a gripper, also with invalid messages."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest
from driving import drive
from nanoseconds import MS, S
from permits import move, set_force

from slipd.devices.external import Decoder
from slipd.devices.external_gripper import Session
from slipd.devices.external_gripper.external_gripper_message import (
    REFUSED,
    encode_notice,
    encode_setpoint,
)
from slipd.tools.sim.emulated_external import DRIVER, PAD, WRENCH, Driver, Pusher, encode_driver_message
from slipd.types.samples import ArmSample


def test_streams_have_the_rates_that_are_asked_for_times_of_this_host_and_an_arm_beside_them() -> None:
    decoder = Decoder()
    emulator = Pusher(1, arms=("arm",), rates_hz={WRENCH: 50.0, PAD: 20.0, "arm": 250.0})
    emulator.began_ns = 7 * S
    emulator.carry(np.array((0.0, 0.0, 9.8)), np.array((1.0, 0.0, 0.0)), sensor="arm")
    samples = [sample for data in emulator.advance(S) for sample in decoder.receive(data, 0)]
    assert Counter(sample.source for sample in samples) == {WRENCH: 50, PAD: 20, "arm": 250}
    times_ns = [sample.device_time_ns for sample in samples]
    assert times_ns == sorted(times_ns)
    assert (times_ns[0], times_ns[-1]) == (7 * S + S / 250, 8 * S)
    motions = [sample for sample in samples if isinstance(sample, ArmSample)]
    assert np.mean([sample.gravity_mps2 for sample in motions], axis=0) == pytest.approx((0.0, 0.0, 9.8), abs=0.01)
    assert np.mean([sample.angular_velocity_radps for sample in motions], axis=0) == pytest.approx((1, 0, 0), abs=0.001)


def test_it_registers_reports_at_its_rate_and_obeys_the_session() -> None:
    driver, session = Driver(), Session()
    driver.opened(0)
    samples = drive(session, driver, 2.0)
    assert len(samples) == pytest.approx(2 * driver.rate_hz, abs=2)
    assert (session.state, session.identity) == ("active", "emulated driver")
    assert (samples[-1].width_m, samples[-1].object) == (0.08, "none")
    assert move(session, 0.0, 0.2, 10.0) == 10.0
    drive(session, driver, 1.0, begin_ns=2000 * MS, start=False)
    assert set_force(session, 12.0) == 12.0
    held = drive(session, driver, 1.0, begin_ns=3000 * MS, start=False)[-1]
    reported = (held.width_m, held.object, held.force_n, held.echo_ok, session.command_lost)
    assert reported == (0.04, "contact_closing", 12.0, True, False)


def test_it_closes_on_the_part_and_opens_again() -> None:
    driver = Driver()
    driver.advance(0)
    driver.receive(encode_setpoint(1, "move", width_m=0.0, speed_mps=None, force_n=9.0), 0)
    driver.advance(200 * MS)
    assert (driver.report.moving, driver.report.object) == (True, "moving")
    driver.advance(1000 * MS)
    held = driver.report
    assert (held.width_m, held.moving, held.object, held.force_n) == (0.04, False, "contact_closing", 9.0)
    driver.receive(encode_setpoint(3, "stop"), 1000 * MS)
    assert (driver.report.object, driver.report.force_n) == ("contact_closing", 9.0)
    driver.receive(encode_setpoint(2, "move", width_m=0.06, speed_mps=0.2, force_n=2.0), 1000 * MS)
    driver.advance(2000 * MS)
    assert (driver.report.width_m, driver.report.object, driver.report.force_n) == (0.06, "none", 0.0)


def test_what_comes_twice_is_done_once_and_answered_twice() -> None:
    driver = Driver()
    force = encode_setpoint(1, "force", force_n=9.0)
    assert [len(driver.receive(force, t_ns)) for t_ns in (0, MS)] == [1, 1]
    assert len(driver.obeyed) == 1
    driver.mute = True
    assert driver.receive(encode_setpoint(2, "stop"), MS) == []


def test_it_survives_garbage_and_registers_again_on_request() -> None:
    driver = Driver()
    driver.advance(0)
    for garbage in (b"\xc1", b"\x81\xa1\xff\x00", b"\x05", encode_setpoint(1, "move"), b"\x81\xa2op\x01"):
        assert driver.receive(garbage, MS) == []
    assert driver.receive(encode_setpoint(2, "stop"), MS) != []
    driver.receive(encode_notice(REFUSED, "the driver must register first"), MS)
    assert driver.advance(2 * MS) == [encode_driver_message(DRIVER)]
