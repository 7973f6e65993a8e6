"""Hash of a ROS 2 type (RIHS01, of REP 2016), by which the two ends of a topic compare their types since ROS 2 Iron."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from typing import Any

from slipd_client.ros.ros_types import RosField, RosType, with_parts

_IDS = {
    "message": 1,
    "int8": 2,
    "uint8": 3,
    "int32": 6,
    "uint32": 7,
    "int64": 8,
    "uint64": 9,
    "float32": 10,
    "float64": 11,
    "bool": 15,
    "byte": 16,
    "string": 17,
}
"""Number of each type in ``type_description_interfaces/msg/FieldType``."""

_ARRAY, _SEQUENCE = 48, 144
"""Added to it for an array, and for a sequence of any length."""


def type_hash(name: str, types: Mapping[str, RosType]) -> str:
    """Return the hash of a type as text: "RIHS01_" and 64 hexadecimal digits.

    Args:
        name: "package/Name".
        types: Every type by its name.
    """
    first, *others = with_parts(name, types)
    description = {
        "type_description": _described(types[first], types),
        "referenced_type_descriptions": [
            _described(kind, types)
            for kind in sorted((types[each] for each in others), key=lambda kind: kind.full_name)
        ],
    }
    return f"RIHS01_{hashlib.sha256(json.dumps(description).encode()).hexdigest()}"


def _described(kind: RosType, types: Mapping[str, RosType]) -> dict[str, Any]:
    fields = [{"name": field.name, "type": _field(field, types)} for field in kind.fields]
    return {"type_name": kind.full_name, "fields": fields}


def _field(field: RosField, types: Mapping[str, RosType]) -> dict[str, Any]:
    nested = types.get(field.type)
    number = _IDS["message" if nested else field.type]
    length = field.length or 0
    if length:
        number += _ARRAY if length > 0 else _SEQUENCE
    return {
        "type_id": number,
        "capacity": max(length, 0),
        "string_capacity": 0,
        "nested_type_name": nested.full_name if nested else "",
    }
