"""What docs/protocol.md says is what the client and its words do."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from slipd_client.messages import (
    ERROR_CODES,
    LEVELS,
    MESSAGE_LIMITS,
    PROTOCOL_VERSION,
    REASONS,
    REQUEST_LIMITS,
    decode,
    encode,
    level_code,
)

TEXT = (Path(__file__).parents[2] / "docs" / "protocol.md").read_text(encoding="utf-8")
EXAMPLES = re.findall(r"```hex\n(.*?)```\s*```json\n(.*?)```", TEXT, re.DOTALL)


def test_it_is_of_this_version() -> None:
    assert TEXT.startswith(f"# The message API, version {PROTOCOL_VERSION}\n")


@pytest.mark.parametrize("level", LEVELS)
def test_every_level_stands_with_its_code(level: str) -> None:
    assert f"| `{level}` | {level_code(level)} |" in TEXT


@pytest.mark.parametrize(("reason", "meaning"), REASONS.items())
def test_every_reason_stands_with_its_meaning(reason: str, meaning: str) -> None:
    assert f"| `{reason}` | {meaning} |" in TEXT


def test_its_error_codes_are_those_of_the_client() -> None:
    table = TEXT.partition("## Error codes")[2].partition("\n## ")[0]
    assert re.findall(r"^\| `(\w+)` \|", table, re.MULTILINE) == list(ERROR_CODES)


@pytest.mark.parametrize("field", ["data_bytes", "text_bytes", "items"])
def test_its_limits_are_those_of_the_decoder(field: str) -> None:
    request, message = f"{getattr(REQUEST_LIMITS, field):,}", f"{getattr(MESSAGE_LIMITS, field):,}"
    assert re.search(rf"^\| .* \| {request}\b.* \| {message} \|$", TEXT, re.MULTILINE)


@pytest.mark.parametrize(("octets", "body"), EXAMPLES, ids=["request", "refusal", "message"])
def test_its_bytes_are_what_it_says_they_are(octets: str, body: str) -> None:
    assert decode(bytes.fromhex(octets)) == json.loads(body)
    assert encode(json.loads(body)) == bytes.fromhex(octets)
