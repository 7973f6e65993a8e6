"""Commands that send one request: types, ranges and help of their arguments come from the schema of the wire."""

from __future__ import annotations

from collections.abc import Callable

from slipd_client.arguments import JSON, Add, Command, argument, escaped, number_in
from slipd_client.messages.fields import FLAG, NUMBER, Field
from slipd_client.messages.ops import OPS

_METAVARS = {"seconds": "S", "width_m": "M", "speed_mps": "MPS"}
"""Of options; a positional argument has the name of its field."""


def type_of(field: Field) -> Callable[[str], str | float]:
    """Return what turns the text of an argument into a value of a field."""
    return number_in(field.number_range, field.allows) if field.kind is NUMBER else str


def help_of(field: Field) -> str:
    """Return what a field is, with its unit, range and default; plain text without markup."""
    default = field.default_text if field.kind is not FLAG else ""
    facts = "; ".join(
        part
        for part in (
            ", ".join(part for part in (field.unit, field.number_range, field.limit if field.pattern else "") if part),
            f"default: {default}" if default else "",
        )
        if part
    )
    meaning = field.meaning.partition("; nil")[0]  # nobody types nil
    return escaped(f"{meaning} ({facts})" if facts else meaning).replace("`", "")


def field_argument(name: str, field: Field) -> Add:
    """Return what adds an argument for a field of an op; required fields and coefficients are positional."""
    if field.kind is FLAG:
        return argument(f"--{name}", action="store_true", help=help_of(field))
    if name == "stream":  # after the finger, as in the client's methods
        return argument(name, metavar="STREAM", choices=field.words, nargs="?", help=help_of(field))
    if field.required or name == "mu_d":
        nargs = None if field.required else "?"
        return argument(name, metavar=name.upper(), type=type_of(field), nargs=nargs, help=help_of(field))
    option, metavar = f"--{name.replace('_', '-')}", _METAVARS[name]
    return argument(option, type=type_of(field), default=field.default, metavar=metavar, help=help_of(field))


def request(name: str, op: str, purpose: str, *fields: str, more: Add | None = None) -> Command:
    """Return the command that sends one request, with an argument for each of these fields of its op."""
    arguments = [field_argument(field, OPS[op].fields[field]) for field in fields]
    arguments += [JSON] if more is None else [more, JSON]
    return Command(name, "slipd_client.slipctl:send_request", purpose, arguments, given={"op": op, "fields": fields})
