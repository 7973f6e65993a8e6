"""The table of the methods of the grip clients in ``clients/README.md``, made from the methods and the schema.

``python -m slipd_client.methods_table clients/README.md`` writes it between its markers.
"""

from __future__ import annotations

import inspect
import re
import sys
from pathlib import Path

from slipd_client.grip import GripClient
from slipd_client.messages.schema.fields import fields_of
from slipd_client.messages.schema.ops import OPS, Op
from slipd_client.messages.schema.replies import Reply, StatusReply
from slipd_client.messages.schema.tables import table

_MARKED = re.compile(r"(<!-- table: methods -->\n).*?(<!-- end of table -->)", re.DOTALL)

_OTHERWISE = {"lease.acquire": "lease"}
"""Methods that are not named like their op."""


def methods_table() -> str:
    """Return the table: a row for each op that has a method."""
    rows = []
    for op in OPS.values():
        method = getattr(GripClient, _OTHERWISE.get(op.name, op.name.replace(".", "_")), None)
        if method is not None:
            parameters = list(inspect.signature(method).parameters.values())[1:]
            call = f"`{method.__name__}({_call(parameters)})`"
            rows.append((call, op.does, _arguments(op, parameters), _returned(op), _linked(op.needs)))
    return table(("method", "what it does", "arguments", "returns", "needs, and is refused without (`code`)"), rows)


def filled(document: str) -> str:
    """Return a document with the present table between its markers."""
    return _MARKED.sub(lambda match: f"{match[1]}{methods_table()}{match[2]}", document)


def _call(parameters: list[inspect.Parameter]) -> str:
    """Return the arguments of a method as its signature has them, without their types."""
    parts = []
    for each in parameters:
        if each.kind is each.KEYWORD_ONLY and "*" not in parts:
            parts.append("*")
        parts.append(each.name if each.default is each.empty else f"{each.name}={each.default!r}")
    return ", ".join(parts)


def _arguments(op: Op, parameters: list[inspect.Parameter]) -> str:
    """Return what each argument is, with its unit and range."""
    found = []
    for field in (op.fields[each.name] for each in parameters):
        facts = ", ".join(part for part in (field.unit, field.range_text) if part)
        found.append(f"`{field.name}`: {field.meaning}" + (f" ({facts})" if facts else ""))
    return "; ".join(found)


def _returned(op: Op) -> str:
    if op.name in _OTHERWISE:
        return "a `with` block that holds the lease"
    if op.reply is StatusReply:
        return "`StatusReply`: the fields of the topic `status`"
    names = ", ".join(f"`{field.name}`" for field in fields_of(op.reply))
    result = "TareResult" if op.name == "tare" else op.reply.__name__
    return "" if op.reply is Reply else f"`{result}`: {names}"


def _linked(needs: str) -> str:
    return needs.replace("](#", "](../docs/protocol.md#")


if __name__ == "__main__":
    path = Path(sys.argv[1])
    path.write_text(filled(path.read_text(encoding="utf-8")), encoding="utf-8")
