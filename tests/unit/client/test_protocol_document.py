"""What docs/protocol.md says is what the client and its words do."""

from __future__ import annotations

import ast
import json
import re

import pytest
from project import DAEMON, DOCS

from slipd.samples import WrenchSample
from slipd_client.messages import (
    ERROR_CODES,
    IMAGE_REASONS,
    LEVELS,
    MESSAGE_LIMITS,
    PROTOCOL_VERSION,
    REASONS,
    REQUEST_LIMITS,
    decode,
    encode,
    level_code,
)
from slipd_client.messages.schema.ops import OPS

TEXT = (DOCS / "protocol.md").read_text(encoding="utf-8")
EXAMPLES = re.findall(r"```hex\n(.*?)```\s*```json\n(.*?)```", TEXT, re.DOTALL)


def test_it_is_of_this_version() -> None:
    assert TEXT.startswith(f"# The message API, version {PROTOCOL_VERSION}\n")


@pytest.mark.parametrize("level", LEVELS)
def test_every_level_stands_with_its_code(level: str) -> None:
    assert f"| `{level}` | {level_code(level)} |" in TEXT


def test_its_reasons_are_those_of_the_client_with_their_meanings() -> None:
    table = TEXT.partition("| reason | meaning |\n")[2].partition("\n\n")[0]
    assert re.findall(r"^\| `(\w+)` \| (.*) \|$", table, re.MULTILINE) == list(REASONS.items())


def test_why_an_image_cannot_be_used_stands_with_its_meaning() -> None:
    table = TEXT.partition("| reason | why an image cannot be used |\n")[2].partition("\n\n")[0]
    assert dict(re.findall(r"^\| `(\w+)` \| (.*) \|$", table, re.MULTILINE)) == IMAGE_REASONS


def test_every_reason_that_the_daemon_gives_has_a_meaning() -> None:
    """Reasons stand in tuples, or are added to a list, in the files that make verdicts."""
    given = {f"disagreement_{what}" for what in ("contact", "centroid", "force")}
    for name in (
        "samples",
        "finger/verdict",
        "finger/three_axis",
        "finger/trust",
        "finger/verdict_batch",
        "finger/force_channel",
    ):
        for node in ast.walk(ast.parse((DAEMON / f"{name}.py").read_text(encoding="utf-8"))):
            if isinstance(node, (ast.Tuple, ast.Set)):
                words = node.elts
            elif isinstance(node, ast.Call) and getattr(node.func, "attr", "") == "append":
                words = node.args
            else:
                continue
            given |= {word.value for word in words if isinstance(word, ast.Constant) and isinstance(word.value, str)}
    models = {"none", "exact"}  # "translation" is a reason too
    others = set(LEVELS) | models | set(WrenchSample.__slots__)
    assert {word for word in given if " " not in word} - others == set(REASONS)


def test_its_error_codes_are_those_of_the_client() -> None:
    table = TEXT.partition("## Error codes")[2].partition("\n## ")[0]
    assert re.findall(r"^\| `(\w+)` \|", table, re.MULTILINE) == list(ERROR_CODES)


def test_its_operations_are_those_of_the_daemon_with_their_fields() -> None:
    table = TEXT.partition("### Operations")[2].partition("\n\n| needs |")[0]
    told = {
        op: {name: not optional for name, optional in re.findall(r"`(\w+)`(\??)", fields)}
        for op, fields in re.findall(r"^\| `([a-z.]+)` \|(.*?)\|", table, re.MULTILINE)
    }
    assert told == {op: {name: field.required for name, field in fields.items()} for op, fields in OPS.items()}


def test_every_field_of_a_request_has_a_range_or_a_meaning() -> None:
    table = TEXT.partition("| field | type | unit and range | |\n")[2].partition("\n\n")[0]
    assert set(re.findall(r"^\| `(\w+)` \|", table, re.MULTILINE)) == {name for op in OPS.values() for name in op}


@pytest.mark.parametrize("field", ["data_bytes", "text_bytes", "items", "values"])
def test_its_limits_are_those_of_the_decoder(field: str) -> None:
    request, message = f"{getattr(REQUEST_LIMITS, field):,}", f"{getattr(MESSAGE_LIMITS, field):,}"
    assert re.search(rf"^\| .* \| {request}\b.* \| {message} \|$", TEXT, re.MULTILINE)


@pytest.mark.parametrize(("octets", "body"), EXAMPLES, ids=["request", "refusal", "message"])
def test_its_bytes_are_what_it_says_they_are(octets: str, body: str) -> None:
    assert decode(bytes.fromhex(octets)) == json.loads(body)
    assert encode(json.loads(body)) == bytes.fromhex(octets)
