"""Test that the documents name tests, files, code and keys that exist."""

from __future__ import annotations

import inspect
import re
import tomllib
from pathlib import Path

import pytest
from project import DAEMON, DOCS, ROOT

from slipd_client.client_base import GripClientBase, operation
from slipd_client.grip import GripClient
from slipd_client.messages.ops import OPS

LEADING_IDS = re.compile(r"test_((?:[A-Z]\d+_)+)")
"""The ids of one test name, at its beginning."""

STRAY_ID = re.compile(r"_([A-Z]\d+)_")
"""What looks like an id anywhere else in a test name."""

ROW = re.compile(r"^\| ([A-Z]\d+) \|(.*)\|(.*)\|(.*)\|$", re.MULTILINE)
"""A row of docs/faults.md: id, fault, handling, tests."""

CITATION = re.compile(r"`([\w/]+\.py)::(\w+)`")
PATH = re.compile(r"`((?:daemon|clients|tests|benchmarks|docs|config)/[\w./-]*)`")
"""A path of the project in backquotes, without a placeholder."""

LINK = re.compile(r"\]\((?!https?:)([^)#\s]*)(?:#([^)\s]*))?\)")
CODE_BLOCK = re.compile(r"^```.*?^```", re.DOTALL | re.MULTILINE)

PAGES = sorted(
    [
        *(ROOT / name for name in ("README.md", "CHANGELOG.md", "clients/README.md", "benchmarks/README.md")),
        *DOCS.rglob("*.md"),
    ]
)
FAULTS = (DOCS / "faults.md").read_text(encoding="utf-8")


DEFINITION = re.compile(r"^\s*(?:async )?def (test_\w+)", re.MULTILINE)
LATER = re.compile(r"^@pytest\.mark\.(?:long|statistics)\b(?:(?!\n\n).)*?def (test_\w+)", re.MULTILINE | re.DOTALL)
"""A test with a mark that `make test` leaves out."""


def ids_of(test: str) -> set[str]:
    found = LEADING_IDS.match(test)
    return set(found[1].strip("_").split("_")) if found else set()


TESTS = [
    (str(file.relative_to(ROOT)), name)
    for file in sorted((ROOT / "tests").rglob("test_*.py"))
    for name in DEFINITION.findall(file.read_text(encoding="utf-8"))
]
"""File and name of every test, without importing or parsing any: every process of the tests collects this."""

ROWS = {row[1]: (row[2], row[3], CITATION.findall(row[4])) for row in ROW.finditer(FAULTS)}


def test_each_fault_id_of_a_test_name_has_exactly_one_row() -> None:
    listed = [row[1] for row in ROW.finditer(FAULTS)]
    assert len(listed) == len(set(listed))
    used = {identifier for _, name in TESTS for identifier in ids_of(name)}
    assert used == set(listed)


def test_ids_stand_only_at_the_beginning_of_a_test_name_and_in_capitals() -> None:
    for _, name in TESTS:
        rest = name.removeprefix("test_")
        for identifier in sorted(ids_of(name), key=len, reverse=True):
            rest = rest.replace(f"{identifier}_", "", 1)
        assert not set(STRAY_ID.findall(f"_{rest}_".upper())) & set(ROWS), name


def test_a_row_names_tests_that_exist_and_carry_its_id() -> None:
    assert len(ROWS) > 40
    for identifier, (fault, handling, cited) in ROWS.items():
        assert fault.strip()[-1] == handling.strip()[-1] == ".", identifier
        assert set() < set(cited) <= {(file, name) for file, name in TESTS if identifier in ids_of(name)}, identifier


def test_make_test_runs_a_test_of_each_fault() -> None:
    words = " ".join((ROOT / "Makefile").read_text(encoding="utf-8").replace("\\\n", " ").split())
    (later,) = re.findall(r"LATER := \$\(addprefix (\S+),([^)]+)\)", words)
    (system,) = re.findall(r"DAEMONS := (\S+)", words)
    (examples,) = re.findall(r"ONE_OF_EACH := \$\(addprefix \$\(DAEMONS\)/test_,([^)]+)\)", words)
    left_out = tuple(f"{later[0]}{place}" for place in later[1].split())
    marked = {
        (file, name) for file in {file for file, _ in TESTS} for name in LATER.findall((ROOT / file).read_text("utf-8"))
    }
    chosen = {f"{system}/test_{example.partition('[')[0]}" for example in examples.split()}
    run = [
        name
        for file, name in TESTS
        if (file, name) not in marked
        and (file.startswith("tests/unit/") or chosen & {file, f"{file}::{name}"})
        and not file.startswith(left_out)
    ]
    assert set(ROWS) - {identifier for name in run for identifier in ids_of(name)} == set()


def test_a_path_that_a_page_names_exists() -> None:
    made_by_the_reader = {
        "daemon/slipd/devices/dynpick.py",
        "tests/unit/devices/test_dynpick.py",
    }
    named = {path: page.name for page in PAGES for path in PATH.findall(page.read_text(encoding="utf-8"))}
    assert {path: page for path, page in named.items() if not (ROOT / path).exists()}.keys() <= made_by_the_reader


def anchors_of(page: Path) -> set[str]:
    """Return the anchors that a forge makes of the headings."""
    headings = re.findall(r"^#+ (.*)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def test_a_link_leads_to_a_page_and_a_heading_that_exist() -> None:
    for page in PAGES:
        prose = CODE_BLOCK.sub("", page.read_text(encoding="utf-8"))
        for target, anchor in LINK.findall(prose):
            file = page.parent / target if target else page
            assert file.exists(), f"{page.name}: {target}"
            assert not anchor or anchor in anchors_of(file), f"{page.name}: {target}#{anchor}"


@pytest.mark.parametrize("name", ["architecture.md", "grip_rules.md", "way_of_a_reading.svg", "way_of_a_request.svg"])
def test_a_file_that_the_architecture_names_exists(name: str) -> None:
    files = [*DAEMON.rglob("*.py"), *(ROOT / "clients" / "slipd_client").rglob("*.py")]
    for named in re.findall(r"[`> ]((?:\w+/)?[a-z]\w*\.py)\b", (DOCS / name).read_text(encoding="utf-8")):
        assert any(file.as_posix().endswith(f"/{named}") for file in files), named


def test_the_table_of_rooms_has_the_order_of_the_imports() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    (layers,) = (c["layers"] for c in project["tool"]["importlinter"]["contracts"] if c.get("containers") == ["slipd"])
    height = {room: -depth for depth, layer in enumerate(layers) for room in layer.split(" | ")}
    text = (DOCS / "architecture.md").read_text(encoding="utf-8")
    heights = [height[room] for room in re.findall(r"^\| `daemon/slipd/(\w+)", text, re.MULTILINE)]
    assert heights == sorted(heights)
    rooms = {folder.name for folder in DAEMON.iterdir() if (folder / "__init__.py").exists()}
    assert rooms <= set(re.findall(r"^\| `daemon/slipd/(\w+)`", text, re.MULTILINE))


def test_the_readme_is_short() -> None:
    assert len((ROOT / "README.md").read_text(encoding="utf-8").splitlines()) <= 110


def test_each_operation_is_a_method_of_its_name_with_its_fields() -> None:
    """As docs/clients.md says, which has no table of the methods."""
    methods = {name for name, each in vars(GripClientBase).items() if isinstance(each, operation)} - {"request"}
    assert methods == {name.replace(".", "_") for name in OPS if not name.startswith("lease.")}
    for name in methods:
        fields = OPS[name.replace("_", ".", 1)].fields if name not in OPS else OPS[name].fields
        parameters = list(inspect.signature(getattr(GripClient, name)).parameters.values())[1:]
        assert {each.name for each in parameters} == set(fields)
        required = [each.name for each in parameters if each.default is each.empty]
        assert required == [each.name for each in fields.values() if each.required]


def test_a_term_has_the_name_in_code_and_on_the_wire_that_the_glossary_states() -> None:
    words = {word for file in DAEMON.rglob("*.py") for word in re.findall(r"\w+", file.read_text(encoding="utf-8"))}
    keys = set(re.findall(r"\w+", (DOCS / "protocol.md").read_text(encoding="utf-8")))
    rows = re.findall(r"^\|(.*?) \| (.*?) \| (.*?) \|", (DOCS / "glossary.md").read_text("utf-8"), re.MULTILINE)
    assert len(rows) > 12
    for term, code, wire in rows[1:]:
        assert set(re.findall(r"`(\w+)`", code)) <= words, f"{term}: not in the daemon"
        assert set(re.findall(r"`(\w+)`", wire)) <= keys, f"{term}: not in docs/protocol.md"
