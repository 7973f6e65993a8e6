"""What the registers of a Robotiq mean: every fault and motion; and tables of forces, which no setting exceeds."""

from __future__ import annotations

import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st

from slipd.devices.robotiq_2f.robotiq_registers import (
    FORCE_TABLE,
    SPEED_TABLE,
    WIDTH_TABLE,
    Units,
    interpolate,
    is_activating,
    parse_status,
)
from slipd.tools.sim.emulated_robotiq_2f import Output, status_registers

TABLE = [(0.0, 3.0), (60.0, 7.5), (120.0, 13.0), (255.0, 30.0)]


@st.composite
def tables(draw: st.DrawFn) -> list[tuple[float, float]]:
    """Rising integer settings within a byte, and forces that rise by at least 0.1 N."""
    units = draw(st.lists(st.integers(0, 255), min_size=2, max_size=6, unique=True))
    steps = draw(st.lists(st.floats(0.1, 50.0), min_size=len(units), max_size=len(units)))
    return list(zip(map(float, sorted(units)), itertools.accumulate(steps), strict=True))


def test_the_tables_of_a_config_without_any_end_where_data_sheet_and_driver_do() -> None:
    tables = ((0, 20.0), (255, 235.0)), ((3 / 255, 0.085), (230 / 255, 0.0)), ((0, 0.020), (255, 0.150))
    assert tables == (FORCE_TABLE, WIDTH_TABLE, SPEED_TABLE)


@pytest.mark.parametrize(
    ("force_n", "units"),
    [*((force_n, units) for units, force_n in TABLE), (5.25, 30), (5.26, 30), (5.24, 29), (1, 0), (1e6, 255)],
)
def test_a_force_is_rounded_down_to_an_integer_setting_within_the_table(force_n: float, units: int) -> None:
    assert Units(TABLE, WIDTH_TABLE, None).force(force_n) == units


@pytest.mark.parametrize(("units", "force_n"), [*TABLE, (30, 5.25), (-10, 3.0), (300, 30.0)])
def test_a_setting_has_the_force_on_the_line_between_two_points(units: float, force_n: float) -> None:
    assert Units(TABLE, WIDTH_TABLE, None).newtons(units) == pytest.approx(force_n)


@given(table=tables(), share=st.floats(0.0, 1.0))
def test_the_applied_force_never_exceeds_the_requested_one(table: list[tuple[float, float]], share: float) -> None:
    least, most = table[0][1], table[-1][1]
    asked = least + share * (most - least)
    forces = Units(table, WIDTH_TABLE, None)
    setting = forces.force(asked)
    assert table[0][0] <= setting <= table[-1][0]
    assert forces.newtons(setting) <= asked * (1.0 + 1e-6)
    if setting < table[-1][0]:
        assert forces.newtons(setting + 1) > asked * (1.0 - 1e-6), "the next setting would still have been allowed"


def test_interpolate_holds_the_ends_of_a_falling_table() -> None:
    widths = [(0.0, 0.085), (1.0, 0.0)]
    found = [interpolate(widths, closure) for closure in (-1.0, 0.0, 0.5, 1.0, 2.0)]
    assert found == pytest.approx([0.085, 0.085, 0.0425, 0.0, 0.0])


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
        output = Output(activate=stage > 0, go=go, position=9, speed=0, force=0)
        registers = status_registers(output, stage=stage, found=found, fault=0, position=51, current_a=0.5)
        sample = parse_status(registers, 0, 9)
        moving = stage == 1 or (go and found == 0)
        thing = ("moving" if moving else "none", "contact_opening", "contact_closing", "none")[found]
        assert (sample.active, sample.moving, sample.object) == (stage == 3, moving, thing)
        assert (sample.current_a, sample.echo_ok, is_activating(registers)) == (0.5, True, stage == 1)


def test_a_gripper_whose_activation_bit_is_clear_is_not_active() -> None:
    assert not parse_status((0x3000, 0, 0), 0, None).active
