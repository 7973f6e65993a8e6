"""Bounds on the values of a config: a value beyond them is a wrong unit or a typing error.

The bounds are wide: they refuse what no rig can have, not what is unusual.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, ConfigDict, Field

Fault = tuple[str, str]
"""A fault of a config: dotted key path, and text."""

MARGIN = 1.25
"""A measured or rounded value may exceed that of the data sheet by this factor."""

QUATERNION_TOLERANCE = 1e-3
"""A quaternion written with four digits is still a unit quaternion."""

ROUNDED_QUATERNION = 0.1
"""Largest difference of a length from 1 that is taken for rounding: the error then gives the unit quaternion."""

MOST_FRICTION = 2.0
"""Rubber on dry, rough glass reaches 2. More is a wrong unit, and makes every grip look safe."""

LEAST_USUAL_FRICTION, USUAL_FRICTION = 0.1, 1.2
"""From oily pads to dry rubber on most objects."""

LONGEST_PAD_M = 0.5
"""The longer side of the largest pad that fits between the jaws of a gripper, m."""

MOST_MIN_NORMAL_N = 50.0
"""A threshold of contact above this hides a grip, N; only where a force sensor measures newtons."""


@dataclass(frozen=True, slots=True)
class Bounds:
    """Range of a quantity; calling it validates a value for pydantic.

    Attributes:
        least: Smallest value.
        most: Largest value.
        unit: Unit of both; "" for plain numbers.
        thousandth: Unit a thousand times smaller that is also used for this quantity; "" if there is none.
        zero: Whether 0 is accepted too, as "none".
        meant: Returns what was probably meant by a value that is too large, as a question; "" if unknown.
    """

    least: float
    most: float
    unit: str
    thousandth: str = ""
    zero: bool = False
    meant: Callable[[float], str] = lambda _: ""

    def fault(self, value: float) -> str:
        """Return what is wrong with a value and what was probably meant; "" if it is within the bounds."""
        if self._holds(value):
            return ""
        unit = f" {self.unit}" if self.unit else ""
        rule = f"must be from {self.least:g} to {self.most:g}{unit}, got {value:g}"
        if value > self.most and (question := self.meant(value)):
            return f"{rule}: {question}"
        meant = value * 1e-3
        if not self.thousandth or abs(value) <= self.most or not self._holds(meant):
            return rule
        return f"{rule}: did you mean {value:g} {self.thousandth}? write {meant:g}"

    def __call__(self, value: Any) -> Any:
        """Return a number or a list of numbers unchanged.

        Raises:
            ValueError: A number is out of bounds.
        """
        for number in value if isinstance(value, list) else (value,):
            if fault := self.fault(number):
                raise ValueError(fault)
        return value

    def _holds(self, value: float) -> bool:
        return self.least <= value <= self.most or (self.zero and value == 0.0)


def within(least: float, most: float, unit: str, thousandth: str = "", *, zero: bool = False) -> AfterValidator:
    """Return the bounds of a key for its annotation; arguments as the attributes of `Bounds`."""
    return AfterValidator(Bounds(least, most, unit, thousandth, zero))


class StrictModel(BaseModel):
    """A table of a config; refuses unknown keys, wrong types, NaN and infinity."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)


def table_fault(rows: Iterable[Iterable[float]], *columns: Bounds | None) -> str:
    """Describe the first value of a table that is out of its column's bounds; "" if there is none."""
    pairs = (pair for row in rows for pair in zip(row, columns, strict=True))
    return next((fault for value, bounds in pairs if bounds is not None and (fault := bounds.fault(value))), "")


def unit_quaternion(quat_xyzw: list[float]) -> list[float]:
    """Return a unit quaternion unchanged.

    Raises:
        ValueError: The length is not 1.
    """
    length = math.hypot(*quat_xyzw)
    if abs(length - 1.0) > QUATERNION_TOLERANCE:
        rule = f"must be a unit quaternion in the order x, y, z, w, got one of length {length:.4g}"
        near = abs(length - 1.0) <= ROUNDED_QUATERNION
        unit = [round(part / length, 7) + 0.0 for part in quat_xyzw] if near else []
        raise ValueError(f"{rule}: its digits are too few; write {unit}" if unit else rule)
    return quat_xyzw


def meant_friction(mu: float) -> str:
    """Return what is probably meant by too large a μ, as a question: a lost point, or percent; "" if unknown."""
    usual = [mu / factor for factor in (10.0, 100.0) if LEAST_USUAL_FRICTION <= mu / factor <= USUAL_FRICTION]
    return f"did you mean {usual[0]:g}?" if usual else ""


PLACE = Bounds(-1.0, 1.0, "m", "mm")
"""A sensor at the wrist sits within a metre of the fingertip, and so does the mass between them."""

WIDTH = Bounds(0.0, 1.0, "m", "mm")
"""Large parallel grippers open by some decimetres."""

GRIP = Bounds(0.0, 5e3, "N", "mN")
"""The strongest electric parallel grippers press with some kilonewtons."""

SPEED = Bounds(0.0, 2.0, "m/s", "mm/s")
"""A jaw that closes at 2 m/s breaks what it grips."""

Place = Annotated[list[float], Field(min_length=3, max_length=3), AfterValidator(PLACE)]
Friction = Annotated[float, AfterValidator(Bounds(0.01, MOST_FRICTION, "", meant=meant_friction))]
Grip = Annotated[float, Field(gt=0.0), AfterValidator(GRIP)]

Slew = Annotated[float, AfterValidator(Bounds(1e-3, 5e4, "N/s", "mN/s"))]
"""From creeping to the full force of the strongest gripper within a tenth of a second."""

Quaternion = Annotated[list[float], Field(min_length=4, max_length=4), AfterValidator(unit_quaternion)]
