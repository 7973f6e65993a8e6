"""What a ROS 2 message type is, and its text: the one declaration that encoders and schemas are made from."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

PRIMITIVES = {
    "bool": "?",
    "byte": "B",
    "int8": "b",
    "uint8": "B",
    "int32": "i",
    "uint32": "I",
    "int64": "q",
    "uint64": "Q",
    "float32": "f",
    "float64": "d",
}
"""Format of ``struct`` of each primitive in use; ``string`` is the only other type that is no message."""

COMMENT_WIDTH = 100
_SEPARATOR = "=" * 80
_LINE = re.compile(r"([\w/]+)(\[\d*\])? (\w+)(?:=(-?\d+))?")


@dataclass(frozen=True)
class RosField:
    """One field of a message.

    Attributes:
        name: Its name.
        type: A primitive, "string", or a message as "package/Name".
        length: None for a single value, -1 for a sequence of any length, else the length of an array.
        comment: What it is, in ASCII; "" if the name explains itself.
    """

    name: str
    type: str
    length: int | None = None
    comment: str = ""

    @property
    def type_text(self) -> str:
        """Its type as in a ``.msg`` file, e.g. "float64[2]"."""
        if self.length is None:
            return self.type
        return f"{self.type}[]" if self.length < 0 else f"{self.type}[{self.length}]"


@dataclass(frozen=True)
class RosType:
    """A message type.

    Attributes:
        name: "package/Name".
        fields: Its fields, in order; at least one.
        constants: Type, name and value of each constant.
        comment: What it is, in ASCII.
    """

    name: str
    fields: tuple[RosField, ...]
    constants: tuple[tuple[str, str, int], ...] = ()
    comment: str = ""

    @property
    def full_name(self) -> str:
        """Name as MCAP files and viewers have it: "package/msg/Name"."""
        package, _, name = self.name.partition("/")
        return f"{package}/msg/{name}"

    def text(self) -> str:
        """Return the definition without comments, one line for each constant and field."""
        constants = [f"{kind} {name}={value}" for kind, name, value in self.constants]
        return "".join(f"{line}\n" for line in constants + [f"{each.type_text} {each.name}" for each in self.fields])

    def commented_text(self) -> str:
        """Return the definition with comments: the text of its ``.msg`` file."""
        parts = [_comment(self.comment)]
        if self.constants:
            parts.append("".join(f"{kind} {name}={value}\n" for kind, name, value in self.constants))
        parts += [f"{_comment(each.comment)}{each.type_text} {each.name}\n" for each in self.fields]
        return "\n".join(parts)


def type_from_text(name: str, text: str) -> RosType:
    """Return the type that a definition without comments declares.

    Raises:
        ValueError: A line is neither a field nor a constant.
    """
    fields, constants = [], []
    for line in text.strip().splitlines():
        match = _LINE.fullmatch(line.strip())
        if match is None:
            raise ValueError(f"{name}: a line must be 'type name' or 'type NAME=value', got {line!r}")
        kind, brackets, word, value = match.groups()
        if value is not None:
            constants.append((kind, word, int(value)))
        else:
            length = None if brackets is None else int(brackets[1:-1] or -1)
            fields.append(RosField(word, kind, length))
    return RosType(name, tuple(fields), tuple(constants))


def schema_text(name: str, types: Mapping[str, RosType]) -> str:
    """Return a type with every type within it, as encoding ``ros2msg`` has them: separated by lines of "=".

    Args:
        name: "package/Name".
        types: Every type by its name.
    """
    first, *others = with_parts(name, types)
    parts = [f"{_SEPARATOR}\nMSG: {each}\n{types[each].text()}" for each in others]
    return types[first].text() + "".join(parts)


def with_parts(name: str, types: Mapping[str, RosType]) -> list[str]:
    """Return a type and the types within it, each once, in the order of their first use."""
    return list(dict.fromkeys(_walk(name, types)))


def _walk(name: str, types: Mapping[str, RosType]) -> Iterator[str]:
    yield name
    for field in types[name].fields:
        if field.type in types:
            yield from _walk(field.type, types)


def _comment(text: str) -> str:
    return "".join(f"# {line}\n" for line in textwrap.wrap(text, COMMENT_WIDTH - 2))
