"""The commands of `slipd emulate`, one a line: what a hand does to the pads of emulated devices."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Collection
from dataclasses import dataclass

HELP = """\
press FINGER FORCE N [at X Y mm] [in S s]    press the pad; default: where it was pressed, or at its centre
push FINGER +x|-x|+y|-y FORCE N [in S s]     push along the pad; it needs a press, or a held object, to act by friction
push FINGER FX FY N [in S s]                 the same by components along X and Y
twist FINGER TORQUE mNm [in S s]             turn about the normal of the pad, likewise
release [FINGER]                             let go of one finger, or of all
pull +x|-x|+y|-y FORCE N [in S s]            pull at the object that the gripper holds; half of it acts on each pad
object WIDTH mm                              put an object between the pads; 0: take it away
friction MU_S [MU_D]                         friction of everything that touches a pad (default 0.6 0.45)
tilt [FINGER] GX GY GZ                       direction of gravity in the pad frame (default 1 0 0)
arm GX GY GZ [turn WX WY WZ] [in S s]        motion in the gripper frame: gravity minus acceleration, m/s²; rad/s
weight FINGER MASS g [at X Y Z mm]           weight of the finger beyond its force sensor
wait S s                                     do nothing for this time
show                                         print the load on each finger
help                                         print this
quit                                         end"""

LONGEST_S = 3600.0
_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_AXES = {"+x": (1.0, 0.0), "-x": (-1.0, 0.0), "+y": (0.0, 1.0), "-y": (0.0, -1.0)}


class CommandError(ValueError):
    """A command is wrong; the text says what would be right."""


@dataclass(frozen=True, slots=True)
class Command:
    """One command, in SI units.

    Attributes:
        verb: First word.
        finger: Name of the finger; "" where the command names none.
        values: Its numbers: force or torque, width, friction, gravity or motion of the arm.
        place_m: Where, m; None if not given.
        direction: Direction along the pad.
        seconds: How long it takes; 0: at once.
    """

    verb: str
    finger: str = ""
    values: tuple[float, ...] = ()
    place_m: tuple[float, ...] | None = None
    direction: tuple[float, float] = (0.0, 0.0)
    seconds: float = 0.0


def parse_command(line: str, fingers: Collection[str]) -> Command | None:
    """Return the command of a line; None for an empty line or a comment (#).

    Args:
        line: The line.
        fingers: Names of the fingers.

    Raises:
        CommandError: The line is not a command.
    """
    words = line.partition("#")[0].split()
    if not words:
        return None
    parse = _PARSERS.get(words[0])
    if parse is None:
        raise CommandError(f"a command must begin with {', '.join(_PARSERS)}, got {words[0]!r:.40}")
    reader = _Words(words, fingers)
    command = parse(reader)
    reader.end()
    return command


class _Words:
    """The words of one command, read from left to right."""

    def __init__(self, words: list[str], fingers: Collection[str]) -> None:
        self.verb, self._rest, self._fingers = words[0], _split_units(words[1:]), fingers

    @property
    def next(self) -> str:
        return self._rest[0] if self._rest else ""

    def finger(self) -> str:
        if self.next not in self._fingers:
            raise self.error(f"FINGER must be one of {', '.join(self._fingers)}")
        return self._rest.pop(0)

    def finger_if_named(self) -> str:
        return self.finger() if self.next and not re.fullmatch(_NUMBER, self.next) else ""

    def direction(self) -> tuple[float, float]:
        if self.next not in _AXES:
            raise self.error(f"the direction must be one of {', '.join(_AXES)}")
        return _AXES[self._rest.pop(0)]

    def number(self, name: str, least: float, most: float) -> float:
        if not re.fullmatch(_NUMBER, self.next):
            raise self.error(f"{name} must be a number")
        value = float(self.next)
        if not least <= value <= most:
            raise self.error(f"{name} must be from {least:g} to {most:g}")
        self._rest.pop(0)
        return value

    def unit(self, *units: str) -> str:
        """Drop the unit, which may be left out; return it."""
        if self.next in units:
            return self._rest.pop(0)
        if re.fullmatch(r"[A-Za-z·]+", self.next) and self.next not in ("at", "in"):
            raise self.error(f"the unit must be {' or '.join(units)}")
        return units[0]

    def place_m(self, count: int) -> tuple[float, ...] | None:
        if not self.took("at"):
            return None
        place = tuple(1e-3 * self.number("XYZ"[k], -500.0, 500.0) for k in range(count))
        self.unit("mm")
        return place

    def took(self, word: str) -> bool:
        """Drop this word; return whether it was there."""
        there = self.next == word
        del self._rest[:there]
        return there

    def seconds(self) -> float:
        if not self.took("in"):
            return 0.0
        value = self.number("S", 0.0, LONGEST_S)
        self.unit("s")
        return value

    def end(self) -> None:
        if self._rest:
            raise self.error("nothing may follow")

    def error(self, rule: str) -> CommandError:
        usage = next(line for line in HELP.splitlines() if line.startswith(self.verb))
        return CommandError(f"{self.verb}: {rule}, got {self.next!r:.40}; usage: {re.split(r'  +', usage)[0]}")


def _split_units(words: list[str]) -> list[str]:
    """Return the words with a unit split from its number: ``5N`` is ``5 N``."""
    found: list[str] = []
    for word in words:
        match = re.fullmatch(rf"({_NUMBER})([A-Za-z·]+)", word)
        found += match.groups() if match else [word]
    return found


def _press(words: _Words) -> Command:
    finger, force_n = words.finger(), words.number("FORCE", 0.0, 1000.0)
    words.unit("N")
    place_m = words.place_m(2)
    return Command(words.verb, finger, (force_n,), place_m, seconds=words.seconds())


def _push(words: _Words) -> Command:
    finger = words.finger() if words.verb == "push" else ""
    if words.verb == "push" and re.fullmatch(_NUMBER, words.next):
        along_x_n, along_y_n = words.number("FX", -1000.0, 1000.0), words.number("FY", -1000.0, 1000.0)
        force_n = math.hypot(along_x_n, along_y_n)
        direction = (along_x_n / force_n, along_y_n / force_n) if force_n else (0.0, 0.0)
    else:
        direction, force_n = words.direction(), words.number("FORCE", 0.0, 1000.0)
    words.unit("N")
    return Command(words.verb, finger, (force_n,), direction=direction, seconds=words.seconds())


def _twist(words: _Words) -> Command:
    finger, torque = words.finger(), words.number("TORQUE", -1e5, 1e5)
    scale = 1.0 if words.unit("mNm", "mN·m", "Nm", "N·m") in ("Nm", "N·m") else 1e-3
    return Command(words.verb, finger, (scale * torque,), seconds=words.seconds())


def _release(words: _Words) -> Command:
    return Command(words.verb, words.finger_if_named())


def _object(words: _Words) -> Command:
    width_m = 1e-3 * words.number("WIDTH", 0.0, 500.0)
    words.unit("mm")
    return Command(words.verb, values=(width_m,))


def _friction(words: _Words) -> Command:
    mu_s = words.number("MU_S", 0.01, 2.0)
    mu_d = words.number("MU_D", 0.01, mu_s) if words.next else 0.75 * mu_s
    return Command(words.verb, values=(mu_s, mu_d))


def _tilt(words: _Words) -> Command:
    finger = words.finger_if_named()
    gravity = tuple(words.number(name, -50.0, 50.0) for name in ("GX", "GY", "GZ"))
    if math.hypot(*gravity) == 0.0:
        raise words.error("the direction must not be 0 0 0")
    return Command(words.verb, finger, gravity)


def _arm(words: _Words) -> Command:
    gravity = tuple(words.number(name, -50.0, 50.0) for name in ("GX", "GY", "GZ"))
    velocity: tuple[float, ...] = (0.0, 0.0, 0.0)
    if words.took("turn"):
        velocity = tuple(words.number(name, -20.0, 20.0) for name in ("WX", "WY", "WZ"))
    return Command(words.verb, values=gravity + velocity, seconds=words.seconds())


def _weight(words: _Words) -> Command:
    finger, mass_kg = words.finger(), 1e-3 * words.number("MASS", 0.0, 10_000.0)
    words.unit("g")
    return Command(words.verb, finger, (mass_kg,), words.place_m(3))


def _wait(words: _Words) -> Command:
    seconds = words.number("S", 0.0, LONGEST_S)
    words.unit("s")
    return Command(words.verb, seconds=seconds)


def _plain(words: _Words) -> Command:
    return Command(words.verb)


_PARSERS: dict[str, Callable[[_Words], Command]] = {
    "press": _press,
    "push": _push,
    "twist": _twist,
    "release": _release,
    "pull": _push,
    "object": _object,
    "friction": _friction,
    "tilt": _tilt,
    "arm": _arm,
    "weight": _weight,
    "wait": _wait,
    "show": _plain,
    "help": _plain,
    "quit": _plain,
}
