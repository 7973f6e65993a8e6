"""Kinds of values on the wire: how the documents and errors name each, and how it is read."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from slipd_client.errors import MessageError
from slipd_client.messages.names import ErrorCode, Health, SlipLevel

Pair = tuple[float, float]
Triple = tuple[float, float, float]
Sextuple = tuple[float, float, float, float, float, float]


class Mismatch(MessageError):  # noqa: N818 - it names what happened
    """A value that is not of its field's kind; its code is "bad_type" or "missing_field"."""

    def __init__(self, code: ErrorCode, rule: str, path: str = "") -> None:
        self.rule = rule
        super().__init__(code, f"{path} {rule}", path)

    def within(self, key: str) -> Mismatch:
        """Return the same fault as seen from the map or list that holds the value."""
        return Mismatch(self.code, self.rule, f"{key}.{self.field}" if self.field else key)


@dataclass(frozen=True)
class Kind:
    """A kind of value.

    Attributes:
        name: In the tables of ``docs/protocol.md``, e.g. "number".
        phrase: In errors, e.g. "a number".
        plural: Several of them, e.g. "numbers".
        read: Returns a decoded value as Python has it, e.g. a list as a tuple; raises Mismatch for another kind.
        part: Class that declares the fields of a map; None for every other kind.
        inner: Kind of the entries of a list, or of a map with any keys.
    """

    name: str
    phrase: str
    plural: str
    read: Callable[[Any], Any]
    part: type[Any] | None = None
    inner: Kind | None = None

    def fits(self, value: Any) -> bool:
        """Return whether a decoded value is of this kind."""
        try:
            self.read(value)
        except Mismatch:
            return False
        return True


def wrong_kind(phrase: str, value: Any) -> Mismatch:
    """Return the fault of a value that is not what ``phrase`` says."""
    return Mismatch("bad_type", f"must be {phrase}, got {value!r:.60}")


def _number(value: Any) -> float:
    if type(value) is float:
        return value
    if type(value) is int:
        return float(value)
    raise wrong_kind("a number", value)


def reader(
    phrase: str, *wanted: type[Any], convert: Callable[[Any], Any] = lambda value: value
) -> Callable[[Any], Any]:
    """Return what reads a value of these types, and refuses every other as not what ``phrase`` says."""

    def read(value: Any) -> Any:
        if type(value) not in wanted:
            raise wrong_kind(phrase, value)
        return convert(value)

    return read


def _vector(count: int, phrase: str) -> Callable[[Any], tuple[float, ...]]:
    def read(value: Any) -> tuple[float, ...]:
        if type(value) is not list or len(value) != count:
            raise wrong_kind(phrase, value)
        return tuple(_each(_number, enumerate(value)))

    return read


def _word(words: Mapping[Any, Any]) -> Callable[[Any], Any]:
    phrase = f"one of {', '.join(map(str, words))}"

    def read(value: Any) -> Any:
        if type(value) not in (str, int) or value not in words:
            raise wrong_kind(phrase, value)
        return words[value]

    return read


def _each(read: Callable[[Any], Any], entries: Iterable[tuple[Any, Any]]) -> Iterator[Any]:
    """Yield the values of a list or map as Python has them; ``entries`` are pairs of index or key, and value."""
    for key, value in entries:
        try:
            yield read(value)
        except Mismatch as mismatch:
            raise mismatch.within(str(key)) from None


def list_of(inner: Kind) -> Kind:
    """Return the kind of a list of any length."""
    phrase = f"a list of {inner.plural}"
    read = reader(phrase, list, convert=lambda values: tuple(_each(inner.read, enumerate(values))))
    return Kind(f"list of {inner.plural}", phrase, "lists", read, inner=inner)


def map_of(inner: Kind) -> Kind:
    """Return the kind of a map with any keys."""
    read = reader("a map", dict, convert=lambda body: dict(zip(body, _each(inner.read, body.items()), strict=True)))
    return Kind(f"map of {inner.plural}", f"a map of {inner.plural}", "maps", read, inner=inner)


NUMBER = Kind("number", "a number", "numbers", _number)
INTEGER = Kind("integer", "an integer", "integers", reader("an integer", int))
TEXT = Kind("string", "a string", "strings", reader("a string", str))
FLAG = Kind("boolean", "true or false", "booleans", reader("true or false", bool))
TEXT_OR_INTEGER = Kind(
    "string or integer", "a string or an integer", "strings or integers", reader("a string or an integer", str, int)
)
PAIR = Kind("[2]", "a list of two numbers", "[2]", _vector(2, "a list of two numbers"))
TRIPLE = Kind("[3]", "a list of three numbers", "[3]", _vector(3, "a list of three numbers"))
SEXTUPLE = Kind("[6]", "a list of six numbers", "[6]", _vector(6, "a list of six numbers"))
ROWS = Kind("rows", "a list of rows", "lists of rows", reader("a list of rows", list))
"""Rows of numbers; who uses them checks what is in each, so that thousands are read at once."""
LEVEL = Kind("string", "a level", "strings", _word({level.value: level for level in SlipLevel}))
HEALTH = Kind("integer", "a health code", "integers", _word({int(health): health for health in Health}))

BY_ANNOTATION = {
    "float": NUMBER,
    "int": INTEGER,
    "str": TEXT,
    "bool": FLAG,
    "Pair": PAIR,
    "Triple": TRIPLE,
    "Sextuple": SEXTUPLE,
    "SlipLevel": LEVEL,
    "Health": HEALTH,
}
"""Kind that the annotation of an attribute stands for, without its ``| None``."""
