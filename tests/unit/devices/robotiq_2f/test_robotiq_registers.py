"""Robotiq registers: published status bytes, and every code of every field."""

from __future__ import annotations

import itertools

import pytest

from slipd.devices.robotiq_2f.robotiq_registers import is_activating, parse_status
from slipd.tools.sim.emulated_robotiq_2f import Output, status_registers


def test_the_position_is_converted_to_a_width() -> None:
    assert parse_status((0xB900, 0x00FF, 0xBD00), 0, None, lambda position: position / 1000).width_m == 0.189


@pytest.mark.parametrize(
    ("code", "name"),
    [
        (0x00, ""),
        (0x05, "activation_needed"),
        (0x07, "activation_bit_not_set"),
        (0x08, "over_temperature"),
        (0x09, "no_communication"),
        (0x0A, "under_voltage"),
        (0x0B, "automatic_release"),
        (0x0C, "internal"),
        (0x0D, "activation_failed"),
        (0x0E, "overcurrent"),
        (0x0F, "automatic_release_completed"),
        (0x01, "fault_1"),
        (0x30, "controller_3"),
        (0x3E, "overcurrent"),
    ],
)
def test_every_fault_has_its_name(code: int, name: str) -> None:
    assert parse_status((0x3900, code << 8, 0), 0, None).fault == name


def test_status_words_describe_the_motion() -> None:
    for stage, found, go in itertools.product(range(4), range(4), (False, True)):
        output = Output(activate=stage > 0, go=go, release=False, position=9, speed=0, force=0)
        registers = status_registers(output, stage=stage, found=found, fault=0, position=51, current_a=0.5)
        sample = parse_status(registers, 0, 9)
        moving = stage == 1 or (go and found == 0)
        assert sample.active == (stage == 3)
        assert sample.moving == moving
        names = ("moving" if moving else "none", "contact_opening", "contact_closing", "none")
        assert sample.object == ("moving" if stage == 1 and found == 0 else names[found])
        assert (sample.current_a, sample.echo_ok) == (0.5, True)
        assert is_activating(registers) is (stage == 1)


def test_a_gripper_whose_activation_bit_is_clear_is_not_active() -> None:
    assert not parse_status((0x3000, 0, 0), 0, None).active
