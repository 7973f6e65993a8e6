"""What a field of the wire is: its key, its kind, its range and its meaning; and how dataclasses declare fields."""

from __future__ import annotations

import dataclasses
import sys
from collections import ChainMap
from collections.abc import Mapping
from dataclasses import MISSING, dataclass
from typing import Any

from slipd_client.messages.schema.kinds import BY_ANNOTATION, Kind, Mismatch, list_of, map_of, reader


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
    def type_name(self) -> str:
        """Its kind in the tables of ``docs/protocol.md``; "?" stands for "or nil"."""
        return self.kind.name + "?" * self.nullable

    @property
    def number_range(self) -> str:
        """The part of its range that is the same on every rig, for people; "" where it has none."""
        bounds = (("above", self.above), ("at least", self.least), ("at most", self.most))
        return " and ".join(f"{word} {bound:g}" for word, bound in bounds if bound is not None)

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
    names = ChainMap(*(vars(sys.modules[base.__module__]) for base in cls.__mro__))
    found = []
    for each in dataclasses.fields(cls):
        if declared := each.metadata.get("wire"):
            kind = _kind(str(each.type).removesuffix(" | None"), names)
            name = declared["name"] or each.name
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


def _kind(annotation: str, names: Mapping[str, Any]) -> Kind:
    """Return the kind that an annotation stands for; ``names`` are those of the module that has it."""
    if annotation in BY_ANNOTATION:
        return BY_ANNOTATION[annotation]
    if annotation.startswith("tuple["):
        return list_of(_kind(annotation[len("tuple[") : -len(", ...]")], names))
    if annotation.startswith("Mapping[str, "):
        return map_of(_kind(annotation[len("Mapping[str, ") : -1], names))
    return _part(names[annotation])
