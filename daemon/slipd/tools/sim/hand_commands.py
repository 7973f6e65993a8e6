"""The commands of ``slipd emulate``, one a line: what a hand does to the pads; and ``slipd touch``, which sends them.

Nothing of the emulation is loaded here, so ``slipd touch`` starts at once.
"""

from __future__ import annotations

import math
import re
import socket
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from slipd.errors import SlipdError

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

ROUNDING_M = 1e-4
"""A place may be this far beyond the edge of a pad: pages and people round."""

_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_NUMBER_WITH_UNIT = re.compile(rf"(?<!\S)({_NUMBER})([A-Za-z·]+)(?!\S)")
_AXES = {"+x": (1.0, 0.0), "-x": (-1.0, 0.0), "+y": (0.0, 1.0), "-y": (0.0, -1.0)}
_PLACE, _FORCES, _GRAVITY, _TURN = ("X", "Y", "Z"), ("FX", "FY"), ("GX", "GY", "GZ"), ("WX", "WY", "WZ")
_BOUNDS = {
    **dict.fromkeys(_PLACE, (-500.0, 500.0)),
    **dict.fromkeys(_FORCES, (-1000.0, 1000.0)),
    **dict.fromkeys(_GRAVITY, (-50.0, 50.0)),
    **dict.fromkeys(_TURN, (-20.0, 20.0)),
    "FORCE": (0.0, 1000.0),
    "TORQUE": (-1e5, 1e5),
    "WIDTH": (0.0, 500.0),
    "MU_S": (0.01, 2.0),
    "MU_D": (0.01, 2.0),
    "MASS": (0.0, 10_000.0),
    "S": (0.0, 3600.0),
}
"""Least and largest value of each number, by its name in `HELP`."""


class CommandError(ValueError):
    """A command is wrong; the text names what would be right."""


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


@dataclass(frozen=True, slots=True)
class _Form:
    """What follows a verb, in this order.

    Attributes:
        finger: Whether it names a finger; "may": it need not.
        directed: Whether a direction follows.
        numbers: Names of its numbers.
        units: Their units, the first of which is the default, each with its size in SI.
        place: Coordinates that may follow ``at``.
        timed: Whether it may say how long it takes.
    """

    finger: str = ""
    directed: bool = False
    numbers: tuple[str, ...] = ()
    units: Mapping[str, float] = field(default_factory=dict)
    place: tuple[str, ...] = ()
    timed: bool = False


_FORMS = {
    "press": _Form("must", numbers=("FORCE",), units={"N": 1.0}, place=_PLACE[:2], timed=True),
    "push": _Form("must", directed=True, numbers=("FORCE",), units={"N": 1.0}, timed=True),
    "twist": _Form("must", numbers=("TORQUE",), units={"mNm": 1e-3, "mN·m": 1e-3, "Nm": 1.0, "N·m": 1.0}, timed=True),
    "release": _Form("may"),
    "pull": _Form(directed=True, numbers=("FORCE",), units={"N": 1.0}, timed=True),
    "object": _Form(numbers=("WIDTH",), units={"mm": 1e-3}),
    "friction": _Form(numbers=("MU_S",)),
    "tilt": _Form("may", numbers=_GRAVITY),
    "arm": _Form(numbers=_GRAVITY, timed=True),
    "weight": _Form("must", numbers=("MASS",), units={"g": 1e-3}, place=_PLACE),
    "wait": _Form(numbers=("S",), units={"s": 1.0}),
    "show": _Form(),
    "help": _Form(),
    "quit": _Form(),
}


Fingers = Mapping[str, tuple[float, float]]
"""How far the pad of each finger reaches from its centre along X and Y, m; infinite for a finger without a pad."""


def parse_command(line: str, fingers: Fingers) -> Command | None:
    """Return the command of a line; None for an empty line or a comment (#).

    Args:
        line: The line.
        fingers: The fingers by name.

    Raises:
        CommandError: The line is not a command.
    """
    words = _NUMBER_WITH_UNIT.sub(r"\1 \2", line.partition("#")[0]).split()
    if not words:
        return None
    if words[0] not in _FORMS:
        raise CommandError(f"a command must begin with {', '.join(_FORMS)}, got {words[0]!r:.40}")
    reader = _Words(words, fingers)
    command = _command(reader, _FORMS[words[0]])
    reader.end()
    return command


def _command(words: _Words, form: _Form) -> Command:
    finger, direction, names = "", (0.0, 0.0), form.numbers
    if form.finger == "must" or (form.finger and words.next and not words.number_is_next):
        finger = words.finger()
    if words.verb == "push" and words.number_is_next:
        names = _FORCES
    elif form.directed:
        direction = words.direction()
    values = words.numbers(names, form.units)
    if names == _FORCES:
        force_n = math.hypot(*values)
        direction = (values[0] / force_n, values[1] / force_n) if force_n else direction
        values = (force_n,)
    elif words.verb == "friction":
        values += (words.number("MU_D", most=values[0]) if words.next else 0.75 * values[0],)
    elif words.verb == "tilt" and not any(values):
        raise words.error("the direction must not be 0 0 0")
    elif words.verb == "arm":
        values += words.option("turn", _TURN) or (0.0, 0.0, 0.0)
    place_m = words.option("at", form.place, {"mm": 1e-3}) if form.place else None
    if words.verb == "press" and place_m is not None:
        words.check_place(finger, place_m)
    (seconds,) = (words.option("in", ("S",), {"s": 1.0}) if form.timed else None) or (0.0,)
    if words.verb == "wait":
        return Command("wait", seconds=values[0])
    return Command(words.verb, finger, values, place_m, direction, seconds)


class _Words:
    """The words of one command, read from left to right."""

    def __init__(self, words: list[str], fingers: Fingers) -> None:
        self.verb, self._rest, self._fingers = words[0], words[1:], fingers

    @property
    def next(self) -> str:
        return self._rest[0] if self._rest else ""

    @property
    def number_is_next(self) -> bool:
        return re.fullmatch(_NUMBER, self.next) is not None

    def finger(self) -> str:
        if self.next not in self._fingers:
            raise self.error(f"FINGER must be one of {', '.join(self._fingers)}")
        return self._rest.pop(0)

    def direction(self) -> tuple[float, float]:
        if self.next not in _AXES:
            raise self.error(f"the direction must be one of {', '.join(_AXES)}")
        return _AXES[self._rest.pop(0)]

    def number(self, name: str, most: float = math.inf) -> float:
        if not self.number_is_next:
            raise self.error(f"{name} must be a number")
        least, most = _BOUNDS[name][0], min(most, _BOUNDS[name][1])
        if not least <= float(self.next) <= most:
            raise self.error(f"{name} must be from {least:g} to {most:g}")
        return float(self._rest.pop(0))

    def numbers(self, names: Sequence[str], units: Mapping[str, float]) -> tuple[float, ...]:
        """Return numbers in SI; their unit may be left out."""
        values, scale = [self.number(name) for name in names], next(iter(units.values()), 1.0)
        if self.next in units:
            scale = units[self._rest.pop(0)]
        elif units and re.fullmatch(r"[A-Za-z·]+", self.next) and self.next not in ("at", "in"):
            raise self.error(f"the unit must be {' or '.join(units)}")
        return tuple(scale * value for value in values)

    def option(self, word: str, names: Sequence[str], units: Mapping[str, float] = {}) -> tuple[float, ...] | None:
        """Return the numbers that follow a word; None if it does not follow."""
        if self.next != word:
            return None
        self._rest.pop(0)
        return self.numbers(names, units)

    def check_place(self, finger: str, place_m: tuple[float, ...]) -> None:
        """Raise where there is no taxel to press."""
        if any(abs(at_m) > reach_m + ROUNDING_M for at_m, reach_m in zip(place_m, self._fingers[finger], strict=True)):
            at, reach = ([f"{1e3 * value_m:g}" for value_m in pair] for pair in (place_m, self._fingers[finger]))
            raise CommandError(
                f"press: at {' '.join(at)} mm the {finger} pad has no taxel: "
                f"X must be from -{reach[0]} to {reach[0]} mm, and Y from -{reach[1]} to {reach[1]} mm"
            )

    def end(self) -> None:
        if self._rest:
            raise self.error("nothing may follow")

    def error(self, rule: str) -> CommandError:
        usage = next(line for line in HELP.splitlines() if line.startswith(self.verb))
        return CommandError(f"{self.verb}: {rule}, got {self.next!r:.40}; usage: {re.split(r'  +', usage)[0]}")


SOCKET = "hand"
"""Name of the local socket for commands."""

OK, ERROR, END = "ok", "error: ", "end"
"""First words of the last line of each answer on the socket."""


def touch_command(folder: Path, words: list[str]) -> bool:
    """Send commands to a running emulation and print the answers; without words, those of standard input.

    Returns:
        Whether every command was carried out.

    Raises:
        SlipdError: No emulation listens there.
    """
    done = True
    with socket.socket(socket.AF_UNIX) as line:
        try:
            line.connect(str(folder / SOCKET))
        except OSError as error:
            raise SlipdError(f"no emulation at {folder}: {error.strerror}; start one: slipd emulate CONFIG") from None
        with line.makefile("rw", encoding="utf-8") as both:
            for text in [" ".join(words)] if words else sys.stdin:
                both.write(text.rstrip("\n") + "\n")
                both.flush()
                for answer in both:
                    if answer.strip() == OK:
                        break
                    print(answer, end="", file=sys.stderr if answer.startswith(ERROR) else sys.stdout, flush=True)
                    if answer.startswith((ERROR, END)):
                        done = done and not answer.startswith(ERROR)
                        break
                else:
                    raise SlipdError("the emulation has ended")
    return done
