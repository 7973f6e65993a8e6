"""What docs/protocol.md and docs/clients.md say is what the client and its words do."""

from __future__ import annotations

import ast
import json
import re
from typing import get_args

import pytest
from project import DAEMON, DOCS
from wire_tables import filled, tables

from slipd.motion.evidence import EVIDENCE as KINDS
from slipd.types.samples import WrenchSample
from slipd_client.messages import (
    ERROR_CODES,
    EVIDENCE,
    LEVELS,
    MESSAGE_LIMITS,
    PROTOCOL_VERSION,
    REASONS,
    REQUEST_LIMITS,
    TARE_REASONS,
    TareReason,
    decode,
    encode,
)
from slipd_client.messages.names import ERROR_MEANINGS, LEVEL_MEANINGS, SlipLevel

TEXT = (DOCS / "protocol.md").read_text(encoding="utf-8")
EXAMPLES = re.findall(r"```hex\n(.*?)```\s*```json\n(.*?)```", TEXT, re.DOTALL)


def test_it_is_of_this_version() -> None:
    assert TEXT.startswith(f"# The message API, version {PROTOCOL_VERSION}\n")


def test_its_tables_are_those_of_the_schema() -> None:
    """``python -m wire_tables docs/protocol.md`` writes them."""
    assert filled(TEXT) == TEXT
    assert sorted(re.findall(r"<!-- table: (\w+) -->", TEXT)) == sorted(tables())


def test_every_word_of_the_wire_has_a_meaning() -> None:
    assert tuple(LEVEL_MEANINGS) == LEVELS == tuple(level.value for level in SlipLevel)
    assert tuple(ERROR_MEANINGS) == ERROR_CODES
    assert tuple(TARE_REASONS) == get_args(TareReason)


def test_every_reason_that_the_daemon_gives_has_a_meaning() -> None:
    """Reasons stand in tuples, or are added to a list, in the files that make verdicts."""
    given = {f"disagreement_{what}" for what in ("contact", "centroid", "force")}
    for name in (
        "types/samples",
        "finger/verdict",
        "finger/image_channel",
        "finger/trust",
        "finger/finger_state",
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
    others = set(LEVELS) | models | set(WrenchSample.__slots__) | {"masked"}  # the last is a reason of an image
    assert {word for word in given if " " not in word} - others == set(REASONS)


def test_every_kind_of_evidence_has_a_meaning() -> None:
    assert tuple(EVIDENCE) == KINDS


@pytest.mark.parametrize("field", ["data_bytes", "text_bytes", "items", "values"])
def test_its_limits_are_those_of_the_decoder(field: str) -> None:
    request, message = f"{getattr(REQUEST_LIMITS, field):,}", f"{getattr(MESSAGE_LIMITS, field):,}"
    assert re.search(rf"^\| .* \| {request}\b.* \| {message} \|$", TEXT, re.MULTILINE)


@pytest.mark.parametrize(("octets", "body"), EXAMPLES, ids=["request"])
def test_its_bytes_are_what_it_says_they_are(octets: str, body: str) -> None:
    assert decode(bytes.fromhex(octets)) == json.loads(body)
    assert encode(json.loads(body)) == bytes.fromhex(octets)
