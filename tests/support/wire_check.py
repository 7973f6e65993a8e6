"""Compares what the engine sends with the schema of the wire: exactly the declared keys, each of its kind."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from slipd.events import Output, Publish, Reply, Request
from slipd_client.messages.fields import Field, Kind, fields_of
from slipd_client.messages.ops import OPS
from slipd_client.messages.topics import TOPICS


def faults_of(output: Output, request: Request | None = None) -> list[str]:
    """What is wrong with a message, or with the reply to a request; nothing where it is as declared."""
    if isinstance(output, Publish):
        return body_faults(fields_of(TOPICS[output.topic.partition(".")[0]]), output.body, output.topic)
    if isinstance(output, Reply) and output.body["ok"] and request is not None:
        op = request.body["op"]
        return body_faults(fields_of(OPS[op].reply), output.body["result"], op)
    return []


def body_faults(fields: Iterable[Field], body: Mapping[str, Any], path: str) -> list[str]:
    """What is wrong with a map."""
    declared = {field.name: field for field in fields}
    found = [f"{path}.{key}: not declared" for key in body.keys() - declared.keys()]
    for name, field in declared.items():
        if name in body:
            found += _value_faults(field, body[name], f"{path}.{name}")
        elif field.required:
            found.append(f"{path}.{name}: missing")
    return found


def _value_faults(field: Field, value: Any, path: str) -> list[str]:
    if value is None:
        return [] if field.nullable else [f"{path}: nil"]
    if not field.kind.fits(value):
        return [f"{path}: {value!r} is not {field.kind.phrase}"]
    return _part_faults(field.kind, value, path)


def _part_faults(kind: Kind, value: Any, path: str) -> list[str]:
    """What is wrong with the maps within a value."""
    if kind.part is not None:
        return body_faults(fields_of(kind.part), value, path)
    if kind.inner is None:
        return []
    entries = value.items() if isinstance(value, dict) else enumerate(value)
    return [fault for key, entry in entries for fault in _part_faults(kind.inner, entry, f"{path}.{key}")]
