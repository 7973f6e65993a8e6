"""What a field of the wire is: key, kind of its value, range and meaning; how dataclasses declare fields."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import MISSING, dataclass
from types import UnionType
from typing import Any, get_args, get_origin, get_type_hints

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


def reader(
    phrase: str, *wanted: type[Any], convert: Callable[[Any], Any] = lambda value: value
) -> Callable[[Any], Any]:
    """Return what reads a value of these types, and refuses every other as not what ``phrase`` says."""

    def read(value: Any) -> Any:
        if type(value) not in wanted:
            raise wrong_kind(phrase, value)
        return convert(value)

    return read


def _vector(count: int, word: str) -> Kind:
    phrase = f"a list of {word} numbers"

    def read(value: Any) -> Any:
        if type(value) is not list or len(value) != count:
            raise wrong_kind(phrase, value)
        return tuple(_each(NUMBER.read, enumerate(value)))

    return Kind(f"[{count}]", phrase, f"[{count}]", read)


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


NUMBER = Kind("number", "a number", "numbers", reader("a number", float, int, convert=float))
INTEGER = Kind("integer", "an integer", "integers", reader("an integer", int))
TEXT = Kind("string", "a string", "strings", reader("a string", str))
FLAG = Kind("boolean", "true or false", "booleans", reader("true or false", bool))
TEXT_OR_INTEGER = Kind(
    "string or integer", "a string or an integer", "strings or integers", reader("a string or an integer", str, int)
)
PAIR, TRIPLE, SEXTUPLE = _vector(2, "two"), _vector(3, "three"), _vector(6, "six")
ROWS = Kind("rows", "a list of rows", "lists of rows", reader("a list of rows", list))
"""Rows of numbers; who uses them checks what is in each, so that thousands are read at once."""
LEVEL = Kind("string", "a level", "strings", _word({level.value: level for level in SlipLevel}))
HEALTH = Kind("integer", "a health code", "integers", _word({int(health): health for health in Health}))

BY_ANNOTATION: dict[Any, Kind] = {
    float: NUMBER,
    int: INTEGER,
    str: TEXT,
    bool: FLAG,
    Pair: PAIR,
    Triple: TRIPLE,
    Sextuple: SEXTUPLE,
    SlipLevel: LEVEL,
    Health: HEALTH,
}
"""Kind that the annotation of an attribute stands for, without its ``| None``."""


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
        above, least, most: Its value is above this, at least this, at most this.
        words: Its value is one of these.
        pattern: Regular expression that the whole of its value matches; "": any value.
        limit: The part of its range that the config or the gripper sets, in words.
        default: Value for requests without it; None where there is no such value.
        omitted: What happens in a request without it, in words.
        needed: A map of a message or reply without it is refused.
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
    pattern: str = ""
    limit: str = ""
    default: float | bool | None = None
    omitted: str = ""
    needed: bool = False

    @property
    def number_range(self) -> str:
        """The part of its range that is the same on every rig, for people; "" where it has none."""
        bounds = (("above", self.above), ("at least", self.least), ("at most", self.most))
        return " and ".join(f"{word} {bound:g}" for word, bound in bounds if bound is not None)

    @property
    def default_text(self) -> str:
        """What a request without it gets, for people; "" where it must be there."""
        if self.omitted or self.default is None:
            return self.omitted
        return str(self.default).lower() if isinstance(self.default, bool) else f"{self.default:g}"

    def allows(self, value: float) -> bool:
        """Return whether a number is within the range that is the same on every rig."""
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
    if isinstance(default, dict):
        return dataclasses.field(default_factory=dict, metadata=metadata)
    if default is MISSING and nil:
        default = None
    return dataclasses.field(default=default, metadata=metadata)


_FIELDS: dict[type[Any], tuple[Field, ...]] = {}
"""Fields of each class, found once."""


def fields_of(cls: type[Any]) -> tuple[Field, ...]:
    """Return the fields that the attributes of a dataclass declare, in their order; none of another class."""
    if cls in _FIELDS:
        return _FIELDS[cls]
    if not dataclasses.is_dataclass(cls):
        return ()
    types = get_type_hints(cls)
    found = []
    for each in dataclasses.fields(cls):
        if declared := each.metadata.get("wire"):
            kind, name = _kind(types[each.name]), declared["name"] or each.name
            needed = each.default is MISSING and each.default_factory is MISSING
            found.append(Field(**declared | {"name": name, "attribute": each.name, "kind": kind, "needed": needed}))
    _FIELDS[cls] = tuple(found)
    return _FIELDS[cls]


def read_fields(cls: type[Any], raw: Mapping[str, Any]) -> dict[str, Any]:
    """Return the attributes of a dataclass by name, as read from the map of a message or reply.

    Raises:
        Mismatch: A field is missing without a default, or its value is of another kind.
    """
    values = {}
    for field in fields_of(cls):
        value = raw.get(field.name)
        if value is not None:
            try:
                values[field.attribute] = field.kind.read(value)
            except Mismatch as mismatch:
                raise mismatch.within(field.name) from None
        elif field.needed:
            raise Mismatch("missing_field", "is missing", field.name)
    return values


def _part(cls: type[Any]) -> Kind:
    read = reader("a map", dict, convert=lambda body: cls(**read_fields(cls, body)))
    return Kind("map", "a map", "maps", read, part=cls)


def _kind(annotation: Any) -> Kind:
    """Return the kind of value that a type stands for; "or None" changes nothing."""
    if annotation in BY_ANNOTATION:
        return BY_ANNOTATION[annotation]
    inner = get_args(annotation)
    if isinstance(annotation, UnionType):
        return _kind(inner[0])
    if get_origin(annotation) is tuple:
        return list_of(_kind(inner[0]))
    return map_of(_kind(inner[1])) if get_origin(annotation) is Mapping else _part(annotation)
