"""What a field of the wire is: its key, its kind, its range and its meaning."""

from __future__ import annotations

import dataclasses
import sys
from collections import ChainMap
from collections.abc import Callable, Mapping
from dataclasses import MISSING, dataclass
from typing import Any

from slipd_client.messages.names import ErrorCode, Health, SlipLevel

Pair = tuple[float, float]
Triple = tuple[float, float, float]
Sextuple = tuple[float, float, float, float, float, float]


class Mismatch(ValueError):  # noqa: N818 - it names what happened
    """A value that is not of its field's kind.

    Attributes:
        code: The kind of fault, as in the ``error`` of a reply: "bad_type" or "missing_field".
        path: Dotted path of the field.
    """

    def __init__(self, code: ErrorCode, rule: str, path: str = "") -> None:
        self.code: ErrorCode = code
        self.rule = rule
        self.path = path
        super().__init__(rule)

    def within(self, key: str) -> Mismatch:
        """Return the same fault as seen from the map or list that holds the value."""
        return Mismatch(self.code, self.rule, f"{key}.{self.path}" if self.path else key)


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


@dataclass(frozen=True)
class Field:
    """One field of a message, request or reply.

    Attributes:
        name: Its key on the wire.
        kind: Kind of its value.
        meaning: What it is, in one sentence.
        nullable: Its value may be nil, which stands for "not known".
        required: Its key is always there.
        only: Where its key is there; "" for everywhere.
        attribute: Its name in Python.
        unit: Its unit, of a request's field; the unit of every other field ends its name.
        above: Its value is above this.
        least: Its value is at least this.
        most: Its value is at most this.
        words: Its value is one of these.
        limit: The part of its range that the config or the gripper sets, in words.
        default: Value for requests without it; None where there is no such value.
        omitted: What happens in a request without it, in words.
    """

    name: str
    kind: Kind
    meaning: str
    nullable: bool = False
    required: bool = True
    only: str = ""
    attribute: str = ""
    unit: str = ""
    above: float | None = None
    least: float | None = None
    most: float | None = None
    words: tuple[str, ...] = ()
    limit: str = ""
    default: float | bool | None = None
    omitted: str = ""

    @property
    def type_name(self) -> str:
        """Its kind in the tables of ``docs/protocol.md``; "?" stands for "or nil"."""
        return self.kind.name + "?" * self.nullable

    @property
    def number_range(self) -> str:
        """The part of its range that is the same on every rig, for people; "" where it has none."""
        bounds = (("above", self.above), ("at least", self.least), ("at most", self.most))
        return ", ".join(f"{word} {bound:g}" for word, bound in bounds if bound is not None)

    @property
    def range_text(self) -> str:
        """Its whole range for people; "" where it has none."""
        words = "one of " + ", ".join(f'"{word}"' for word in self.words) if self.words else ""
        return ", ".join(part for part in (self.number_range, words, self.limit) if part)

    @property
    def default_text(self) -> str:
        """What a request without it gets, for people; "" where it must be there."""
        if self.omitted or self.default is None:
            return self.omitted
        return str(self.default).lower() if isinstance(self.default, bool) else f"{self.default:g}"

    def has(self, value: float) -> bool:
        """Return whether a number is within the range that is the same on every rig; NaN never is."""
        return (
            (self.above is None or value > self.above)
            and (self.least is None or value >= self.least)
            and (self.most is None or value <= self.most)
        )

    def optional(self) -> Field:
        """Return the same field for an op whose requests may leave it out."""
        return dataclasses.replace(self, required=False)


def wire(meaning: str, *, key: str = "", nil: bool = False, default: Any = MISSING, only: str = "") -> Any:
    """Declare a field of a message or reply: the value of an attribute of a dataclass.

    Args:
        meaning: What it is, in one sentence.
        key: Its key on the wire, where that is not the attribute's name.
        nil: It may be nil; the attribute is then None.
        default: The attribute's value where the key is missing, as from an older daemon; without a default (and without
            ``nil``) a map that lacks the key is refused.
        only: Which maps have the key, e.g. "pads"; all by default.
    """
    metadata = {"wire": {"name": key, "meaning": meaning, "nullable": nil, "required": not only, "only": only}}
    if default is MISSING and nil:
        default = None
    if isinstance(default, dict):
        return dataclasses.field(default_factory=dict, metadata=metadata)
    if default is MISSING:
        return dataclasses.field(metadata=metadata)
    return dataclasses.field(default=default, metadata=metadata)


_FIELDS: dict[type[Any], tuple[Field, ...]] = {}
"""Fields of each class, found once."""

_PLANS: dict[type[Any], tuple[tuple[str, str, Callable[[Any], Any], bool], ...]] = {}
"""How to read each class, found once."""


def fields_of(cls: type[Any]) -> tuple[Field, ...]:
    """Return the fields that the attributes of a dataclass declare, in their order; none of another class."""
    if not dataclasses.is_dataclass(cls):
        return ()
    if cls in _FIELDS:
        return _FIELDS[cls]
    found = []
    for each in dataclasses.fields(cls):
        declared = each.metadata.get("wire")
        if declared is not None:
            name = declared["name"] or each.name
            found.append(Field(**declared | {"name": name, "attribute": each.name, "kind": _kind_of(cls, each)}))
    _FIELDS[cls] = tuple(found)
    return _FIELDS[cls]


def read_fields(cls: type[Any], raw: Mapping[str, Any]) -> dict[str, Any]:
    """Return the attributes of a dataclass by name, as read from the map of a message or reply.

    Raises:
        Mismatch: A field is missing without a default, or its value is of another kind.
    """
    values = {}
    for attribute, key, read, needed in _PLANS.get(cls) or _plan(cls):
        value = raw.get(key)
        if value is not None:
            try:
                values[attribute] = read(value)
            except Mismatch as mismatch:
                raise mismatch.within(key) from None
        elif needed:
            raise Mismatch("missing_field", "is missing", key)
    return values


def _plan(cls: type[Any]) -> tuple[tuple[str, str, Callable[[Any], Any], bool], ...]:
    """Look up attribute, key, reader and whether there is no default, of each field."""
    without_default = {
        each.name for each in dataclasses.fields(cls) if each.default is MISSING and each.default_factory is MISSING
    }
    _PLANS[cls] = tuple(
        (each.attribute, each.name, each.kind.read, each.attribute in without_default) for each in fields_of(cls)
    )
    return _PLANS[cls]


def _mismatch(phrase: str, value: Any) -> Mismatch:
    return Mismatch("bad_type", f"must be {phrase}, got {value!r:.60}")


def _number(value: Any) -> float:
    if type(value) is float:
        return value
    if type(value) is int:
        return float(value)
    raise _mismatch("a number", value)


def _exactly(wanted: type[Any], phrase: str) -> Callable[[Any], Any]:
    def read(value: Any) -> Any:
        if type(value) is not wanted:
            raise _mismatch(phrase, value)
        return value

    return read


def _text_or_integer(value: Any) -> Any:
    if type(value) not in (str, int):
        raise _mismatch("a string or an integer", value)
    return value


def _vector(count: int, phrase: str) -> Callable[[Any], tuple[float, ...]]:
    def read(value: Any) -> tuple[float, ...]:
        if type(value) is not list or len(value) != count:
            raise _mismatch(phrase, value)
        return _entries(_number, value)

    return read


def _word(words: Mapping[Any, Any]) -> Callable[[Any], Any]:
    phrase = f"one of {', '.join(map(str, words))}"

    def read(value: Any) -> Any:
        if type(value) not in (str, int) or value not in words:
            raise _mismatch(phrase, value)
        return words[value]

    return read


def _entries(read: Callable[[Any], Any], values: list[Any]) -> tuple[Any, ...]:
    try:
        return tuple(map(read, values))
    except Mismatch:
        for index, value in enumerate(values):
            try:
                read(value)
            except Mismatch as mismatch:
                raise mismatch.within(str(index)) from None
        raise


def _list_of(inner: Kind) -> Kind:
    def read(value: Any) -> tuple[Any, ...]:
        if type(value) is not list:
            raise _mismatch(f"a list of {inner.plural}", value)
        return _entries(inner.read, value)

    return Kind(f"list of {inner.plural}", f"a list of {inner.plural}", "lists", read, inner=inner)


def _map_of(inner: Kind) -> Kind:
    def read(value: Any) -> dict[str, Any]:
        if type(value) is not dict:
            raise _mismatch("a map", value)
        found = {}
        for key, entry in value.items():
            try:
                found[key] = inner.read(entry)
            except Mismatch as mismatch:
                raise mismatch.within(key) from None
        return found

    return Kind(f"map of {inner.plural}", f"a map of {inner.plural}", "maps", read, inner=inner)


def _part(cls: type[Any]) -> Kind:
    def read(value: Any) -> Any:
        if type(value) is not dict:
            raise _mismatch("a map", value)
        return cls(**read_fields(cls, value))

    return Kind("map", "a map", "maps", read, part=cls)


NUMBER = Kind("number", "a number", "numbers", _number)
INTEGER = Kind("integer", "an integer", "integers", _exactly(int, "an integer"))
TEXT = Kind("string", "a string", "strings", _exactly(str, "a string"))
FLAG = Kind("boolean", "true or false", "booleans", _exactly(bool, "true or false"))
TEXT_OR_INTEGER = Kind("string or integer", "a string or an integer", "strings or integers", _text_or_integer)
PAIR = Kind("[2]", "a list of two numbers", "[2]", _vector(2, "a list of two numbers"))
TRIPLE = Kind("[3]", "a list of three numbers", "[3]", _vector(3, "a list of three numbers"))
SEXTUPLE = Kind("[6]", "a list of six numbers", "[6]", _vector(6, "a list of six numbers"))
LEVEL = Kind("string", "a level", "strings", _word({level.value: level for level in SlipLevel}))
HEALTH = Kind("integer", "a health code", "integers", _word({int(health): health for health in Health}))

_BY_ANNOTATION = {
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


def _kind_of(cls: type[Any], attribute: dataclasses.Field[Any]) -> Kind:
    """Return the kind that the annotation of an attribute stands for."""
    modules = {base.__module__: None for base in cls.__mro__}
    names = ChainMap(*(vars(sys.modules[module]) for module in modules))
    return _kind(str(attribute.type).removesuffix(" | None"), names)


def _kind(annotation: str, names: Mapping[str, Any]) -> Kind:
    if annotation in _BY_ANNOTATION:
        return _BY_ANNOTATION[annotation]
    if annotation.startswith("tuple["):
        return _list_of(_kind(annotation[len("tuple[") : -len(", ...]")], names))
    if annotation.startswith("Mapping[str, "):
        return _map_of(_kind(annotation[len("Mapping[str, ") : -1], names))
    return _part(names[annotation])
