"""The atlas shows every kind of failure of a method."""

from __future__ import annotations

import hashlib
import math

from chart.atlas import cell, run
from chart.failures import GROUPS, ROWS
from chart.methods import METHODS, Method
from chart.scenes import Scene

BY_NAME = {row.name: row for row in ROWS}
PAIR = BY_NAME["two, no force"]
SLIDES = BY_NAME["R = 1.5 μ"]
LOST = BY_NAME["NaN load"]

COMPUTED_INPUTS = {"between twins", "three, 120° apart", "turned by 0.7 rad"} | {
    f"beside a taxel, 1e{exponent} pitch" for exponent in (-3, -6, -9, -12)
}
"""Rows whose limit is a closed form of inputs that are computed: those inputs may differ in their last digit."""
DIGEST = "fd739646763d4f52aa9dcfe01c88b8a78d5c9a2d14dd6693aa3baff9ae9ed0eb"


def answering(limit: float) -> Method:
    return Method("it", "it", lambda scene: limit)


def test_a_cell_shows_the_error_and_its_sign() -> None:
    right, scale = PAIR.limit_nm, PAIR.scale_nm
    assert cell(answering(right), PAIR) == "✓"
    assert cell(answering(right + 3e-8 * scale), PAIR) == "3e-08"
    assert cell(answering(right - 0.25 * scale), PAIR) == "−0.25"
    assert cell(answering(right + 0.03 * scale), PAIR) == "**+0.03**"
    assert cell(answering(3.0 * right), PAIR) == "**×3**"
    assert cell(answering(math.inf), PAIR) == "**∞**"
    assert cell(answering(-math.inf), PAIR) == "*slides*"


def test_a_cell_shows_how_a_method_failed() -> None:
    def raising(scene: Scene) -> float:
        raise ZeroDivisionError

    def endless(scene: Scene) -> float:
        while True:
            pass

    assert cell(answering(math.nan), PAIR) == "*none*"
    assert cell(Method("it", "it", raising), PAIR) == "*ZeroDivisionError*"
    assert cell(Method("it", "it", endless), PAIR, limit_s=0.01) == "*late*"


def test_where_no_limit_exists_a_cell_shows_the_result() -> None:
    assert cell(answering(-math.inf), SLIDES) == "✓"
    assert cell(answering(1.0), SLIDES) == "**holds**"
    assert cell(answering(math.nan), SLIDES) == "*none*"
    assert cell(answering(math.nan), LOST) == "✓"
    assert cell(answering(0.1), LOST) == "**number**"


def test_the_page_has_a_column_for_every_method_and_a_table_for_every_group() -> None:
    page = run(quick=True)
    heads = [line for line in page.splitlines() if line.startswith("| contact ")]
    assert len(heads) == len(GROUPS)
    assert all(f"## {group}\n" in page for group in GROUPS)
    assert heads[0].split(" | ")[1:] == [*(m.short for m in METHODS[:-1]), METHODS[-1].short + " |"]


def test_every_input_of_a_stored_limit_is_the_same_on_every_processor() -> None:
    digest = hashlib.sha256()
    for row in ROWS:
        if row.name not in COMPUTED_INPUTS:
            for values in (row.scene.x, row.scene.y, row.scene.loads, row.scene.tangential, row.scene.about):
                digest.update(values.astype("<f8").tobytes())
    assert digest.hexdigest() == DIGEST
