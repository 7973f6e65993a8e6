"""What a scientist imports in a notebook: examples that run, contacts and loads as arguments, errors that name one."""

from __future__ import annotations

import doctest
import importlib
import inspect
import math
import subprocess
import sys
from functools import partial
from typing import Any

import numpy as np
import pytest

import slipd.fusion
from slipd.fusion import (
    binary_loads,
    contact_from_wrench,
    contact_shape,
    grey_loads,
    grip_needed_n,
    matched_loads,
    tipping_margin,
    torque_limit,
    torque_limits,
    utilisation,
    utilisations,
)

FUNCTIONS = {name: found for name in slipd.fusion.__all__ if inspect.isfunction(found := getattr(slipd.fusion, name))}
X, Y = (grid.ravel() for grid in np.meshgrid(np.arange(5) * 0.003 - 0.006, np.arange(4) * 0.003 - 0.0045))
IMAGE = np.clip(1.0 - (X / 0.007) ** 2 - (Y / 0.005) ** 2, 0.0, None)
CONTACT = contact_from_wrench((1.0, 0.5, -8.0), (0.004, 0.008, 0.002))
LOADS = matched_loads(X, Y, IMAGE, CONTACT)
MU = 0.6
WITH_ARRAYS = (X, Y, LOADS.loads, MU, CONTACT.tangential_n)
FORCE, SPIN, ABOUT = CONTACT.tangential_n, CONTACT.spin_nm, CONTACT.centroid_m


@pytest.mark.parametrize("name", FUNCTIONS)
def test_each_public_function_has_an_example_that_runs(name: str) -> None:
    module = importlib.import_module(FUNCTIONS[name].__module__)
    (test,) = doctest.DocTestFinder(recurse=False).find(FUNCTIONS[name], name, globs=dict(vars(module)))
    found = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS).run(test)
    assert found.attempted > 0
    assert found.failed == 0


def test_a_contact_and_its_loads_ask_what_their_numbers_ask() -> None:
    assert LOADS.loads.tolist() == matched_loads(X, Y, IMAGE, CONTACT.normal_n, ABOUT).loads.tolist()
    binary = binary_loads(X, Y, CONTACT)
    assert binary.loads.tolist() == binary_loads(X, Y, CONTACT.normal_n, ABOUT).loads.tolist()
    assert grey_loads(IMAGE, CONTACT).loads.tolist() == grey_loads(IMAGE, CONTACT.normal_n).loads.tolist()
    for sense in (1, -1):
        limit, same = torque_limit(CONTACT, LOADS, MU, sense=sense), torque_limit(*WITH_ARRAYS, ABOUT, sense)
        assert limit.torque_nm == same.torque_nm
    used = utilisation(CONTACT, LOADS, MU)
    assert used.twist == utilisation(*WITH_ARRAYS, SPIN, ABOUT).twist
    assert grip_needed_n(CONTACT, LOADS, MU, growth=0.3) == grip_needed_n(*WITH_ARRAYS, SPIN, ABOUT, growth=0.3)
    on = LOADS.loads > 0.0
    assert tipping_margin(CONTACT, LOADS) == tipping_margin(X[on], Y[on], ABOUT)
    grey = grey_loads(IMAGE, CONTACT, X, Y)
    assert utilisation(CONTACT, grey, MU).value == utilisation(X, Y, grey, MU, FORCE, SPIN, ABOUT).value


WRONG: list[tuple[Any, tuple[Any, ...], str]] = [
    (contact_from_wrench, ("push", (0, 0, 0)), "force must be numbers, got str"),
    (contact_from_wrench, ((0, 0, -1), "twist"), "torque must be numbers, got str"),
    (grey_loads, ({}, 1.0), "pressure must be numbers, got dict"),
    (grey_loads, ([1.0], LOADS), "normal_n must be numbers, got Loads"),
    (grey_loads, ([1.0], 1.0, [0.0]), r"y must have shape \(n,\), got \(\)"),
    (matched_loads, (X, Y, IMAGE, 8.0), r"centroid must have shape \(2,\), got \(\)"),
    (binary_loads, ([0, "b"], [0, 0], 1.0, (0, 0)), "x must be numbers, got list"),
    (utilisation, (X, Y, LOADS.loads, None, FORCE, SPIN, ABOUT), "mu is missing"),
    (utilisation, (X, LOADS, LOADS.loads, MU, FORCE, SPIN, ABOUT), "y must be numbers, got Loads"),
    (utilisation, (X, Y, LOADS, MU, FORCE, CONTACT, ABOUT), "spin must be numbers, got Contact"),
    (utilisation, (X, Y, LOADS, MU, "f", SPIN, ABOUT), "tangential must be numbers, got str"),
    (torque_limit, (X, Y, LOADS, MU, FORCE, "C"), "about must be numbers, got str"),
    (utilisation, (CONTACT, LOADS.loads, MU), "loads beside a Contact must be Loads .* got ndarray"),
    (utilisation, (CONTACT, grey_loads(IMAGE, 8.0), MU), "grey_loads with x and y; got Loads"),
    (grip_needed_n, (CONTACT, LOADS, "rubber"), "mu must be numbers, got str"),
    (tipping_margin, (X, Y, "C"), "point must be numbers, got str"),
    (torque_limits, (X, Y, [LOADS.loads], MU, [FORCE], {}), "about must be numbers, got dict"),
    (
        utilisation,
        (X, Y, LOADS, [0.5, 0.6], FORCE, SPIN, ABOUT),
        r"mu must be one number, got an array of shape \(2,\)",
    ),
    (utilisations, (X, Y, [LOADS.loads], np.ones(2), [FORCE], [SPIN], ABOUT), "mu must be one number, got an array"),
    (grey_loads, ([1.0], np.ones(2)), "normal_n must be one number, got an array"),
    (torque_limits, (X, Y, [LOADS.loads], MU, [FORCE], ABOUT, 0), "sense must be"),
    (utilisations, (X, Y, [LOADS.loads], "rubber", [FORCE], [SPIN], ABOUT), "mu must be numbers, got str"),
    (contact_shape, (X, Y, "image", 0.003), "pressure must be numbers, got str"),
    (contact_shape, (X, Y, np.zeros(20), 0.003), "rows, cols"),
    (contact_from_wrench, ((0, 0), (0, 0, 0)), r"shape \(3,\)"),
    (partial(contact_from_wrench, min_normal_n=0.0), ((0, 0, -1), (0, 0, 0)), "min_normal_n"),
    (grey_loads, ([1.0, math.nan], 1.0), "finite"),
    (grey_loads, ([1.0], -1.0), "normal_n"),
    (binary_loads, ([0, 1], [0], 1.0, (0, 0)), "shape"),
    (matched_loads, ([0, 1], [0, 1], [1], 1.0, (0, 0)), "shape of x"),
    (tipping_margin, ([0, 1], [0], (0, 0)), "shape"),
    (partial(grip_needed_n, safety=0.5), (X, Y, LOADS.loads, MU, (0, 0), 0.0, (0, 0)), "safety"),
    (partial(grip_needed_n, growth=-1.0), (X, Y, LOADS.loads, MU, (0, 0), 0.0, (0, 0)), "growth"),
]


@pytest.mark.parametrize(("function", "arguments", "text"), WRONG)
def test_an_error_names_the_argument_that_was_passed_wrongly(
    function: Any, arguments: tuple[Any, ...], text: str
) -> None:
    with pytest.raises((TypeError, ValueError), match=text):
        function(*arguments)


@pytest.mark.process
def test_an_import_compiles_nothing() -> None:
    code = (
        "import slipd.fusion\n"
        "from slipd.fusion.compiled import KERNELS, PARTS\n"
        "assert len(KERNELS + PARTS) > 20\n"
        "print([kernel.__name__ for kernel in KERNELS + PARTS if getattr(kernel, 'signatures', [])])\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=100)
    assert done.stdout == "[]\n"
