"""JSON channels: read with the library of MCAP, checked against their schemas."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jsonschema import Draft202012Validator
from mcap.reader import make_reader

from slipd.tools.export.json_schema import json_schema
from slipd_client.messages.schema.topics import TOPICS

if TYPE_CHECKING:
    from conftest import Dated

PLAIN = {"number", "integer", "string", "boolean", "object", "array"}


def with_nil(value: Any, like: Any) -> Any:
    """Return a map as it was on the wire, given that map: nil where a key is missing, points as lists."""
    if isinstance(like, dict):
        assert set(value) <= set(like)
        return {key: with_nil(value.get(key), each) for key, each in like.items()}
    if isinstance(like, list) and value and isinstance(value[0], dict):
        return [[point["x"], point["y"]] for point in value]
    return value


def test_every_message_fits_its_schema_and_holds_all_that_is_known(exported: dict[str, Path], dated: Dated) -> None:
    checks: dict[int, Draft202012Validator] = {}
    with exported["json-mcap"].open("rb") as file:
        read = list(make_reader(file).iter_messages(log_time_order=False))
    assert len(read) == len(dated)
    for (schema, channel, message), (log_ns, topic, body) in zip(read, dated, strict=True):
        assert schema is not None
        if schema.id not in checks:
            assert (schema.encoding, channel.message_encoding) == ("jsonschema", "json")
            checks[schema.id] = Draft202012Validator(json.loads(schema.data))
        value = json.loads(message.data)
        checks[schema.id].validate(value)
        assert (channel.topic, message.log_time, message.sequence) == (topic, log_ns, body["seq"])
        assert with_nil(value, body) == body


def properties(schema: dict[str, Any]) -> Iterator[dict[str, Any]]:
    for each in (*schema.get("properties", {}).values(), *filter(None, [schema.get("items")])):
        yield each
        yield from properties(each)


def test_a_schema_has_only_what_viewers_read() -> None:
    """Lichtblick's reader of schemas wants one plain type for each property, and no list within a list."""
    for cls in TOPICS.values():
        schema = json_schema(cls)
        Draft202012Validator.check_schema(schema)
        for each in properties(schema):
            assert each["type"] in PLAIN
            assert each["type"] != "array" or each["items"]["type"] not in ("array", "null")


def test_a_message_that_lacks_a_field_or_has_another_does_not_fit(dated: Dated) -> None:
    check = Draft202012Validator(json_schema(TOPICS["warning"]))
    body = next(body for _, topic, body in dated if topic == "warning")
    known = {key: value for key, value in body.items() if value is not None}
    assert check.is_valid(known)
    assert not check.is_valid({key: value for key, value in known.items() if key != "level"})
    assert not check.is_valid(known | {"mood": "calm"})
    assert not check.is_valid(known | {"utilisation": None})
