"""Entries of the journal, on a real datagram socket, and the lines that it reads from standard error."""

from __future__ import annotations

import io
import logging
import os
import re
import socket
import struct
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from project import DAEMON, DOCS

from slipd.io.log_lines import BURST, JournalHandler, PriorityFormatter, is_journal, open_log

FORMATTER = PriorityFormatter("%(message)s")


def record(level: int = logging.WARNING, message: str = "gone", **fields: object) -> logging.LogRecord:
    made = logging.LogRecord("slipd.io.transport.link", level, "link.py", 12, message, (), None, "_report_down")
    made.__dict__.update(fields)
    return made


class Journal:
    """A journal, a handler that sends to it, and the lines that it does not take."""

    def __init__(self, path: Path, receiver: socket.socket) -> None:
        self.path, self.receiver, self.lines = path, receiver, io.StringIO()
        receiver.bind(str(path))
        receiver.settimeout(10.0)
        fallback = logging.StreamHandler(self.lines)
        fallback.setFormatter(FORMATTER)
        self.handler = JournalHandler(str(path), fallback)

    def entry(self) -> dict[str, str]:
        """Return the fields of the next entry, decoded by the documented rules of the protocol."""
        found, entry = {}, self.receiver.recv(65536)
        while entry:
            head, _, entry = entry.partition(b"\n")
            name, equals, value = head.partition(b"=")
            if not equals:
                (length,) = struct.unpack_from("<Q", entry)
                value, end, entry = entry[8 : 8 + length], entry[8 + length : 9 + length], entry[9 + length :]
                assert end == b"\n"
            assert re.fullmatch(rb"[A-Z][A-Z0-9_]{0,63}", name)
            found[name.decode()] = value.decode()
        return found


@pytest.fixture
def journal(tmp_path: Path) -> Iterator[Journal]:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as receiver:
        made = Journal(tmp_path / "journal", receiver)
        yield made
        made.handler.close()


FIELDS = {
    "PRIORITY": "4",
    "SYSLOG_IDENTIFIER": "slipd",
    "LOGGER": "slipd.io.transport.link",
    "CODE_FILE": "link.py",
    "CODE_LINE": "12",
    "CODE_FUNC": "_report_down",
}
FORGED = "one\nPRIORITY=0\nSLIPD_FAULT=none\n"


@pytest.mark.parametrize(
    ("message", "extra", "expected"),
    [
        (
            "gone",
            {"slipd_stream": "left.wrench", "slipd_fault": "stream-missing"},
            {"SLIPD_FINGER": "left", "SLIPD_STREAM": "left.wrench", "SLIPD_FAULT": "stream-missing"},
        ),
        ("gone", {"slipd_stream": "gripper"}, {"SLIPD_STREAM": "gripper"}),
        (FORGED, {"slipd_recording": FORGED}, {"SLIPD_RECORDING": FORGED.replace("\n", "\\n")}),
    ],
    ids=["a finger", "no finger", "no value can add a field"],
)
def test_an_entry_has_fields(message: str, extra: dict[str, str], expected: dict[str, str], journal: Journal) -> None:
    journal.handler.handle(record(message=message, **extra))
    assert journal.entry() == FIELDS | {"MESSAGE": message} | expected
    assert journal.lines.getvalue() == ""


def test_what_the_journal_does_not_take_is_written_with_its_priority(journal: Journal) -> None:
    journal.handler.handle(record(message="x" * 10_000_000))
    journal.receiver.close()
    journal.path.unlink()
    journal.handler.handle(record(logging.ERROR))
    assert journal.lines.getvalue() == "<4>" + "x" * 10_000_000 + "\n<3>gone\n"


def test_every_line_has_its_priority() -> None:
    levels = {logging.DEBUG: 7, logging.INFO: 6, logging.WARNING: 4, logging.ERROR: 3, logging.CRITICAL: 2}
    assert [FORMATTER.format(record(level)) for level in levels] == [f"<{number}>gone" for number in levels.values()]
    assert FORMATTER.format(record(message="a\nb")) == "<4>a\n<4>b"


def test_the_journal_is_known_by_the_file_behind_the_stream(tmp_path: Path) -> None:
    with (tmp_path / "stream").open("w", encoding="utf-8") as stream:
        found = os.fstat(stream.fileno())
        named = [f"{found.st_dev}:{found.st_ino}", f"{found.st_dev}:{found.st_ino + 1}"]
        assert [is_journal(stream, {"JOURNAL_STREAM": each}) for each in named] == [True, False]
        assert not is_journal(stream, {})
    assert not is_journal(stream, {"JOURNAL_STREAM": "1:2"})


def test_a_process_whose_errors_the_journal_reads_sends_entries_and_lines_once_it_is_gone(
    journal: Journal, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.WARNING)  # as before a log is opened; it is restored
    with (tmp_path / "stderr").open("w+", encoding="utf-8") as stream, monkeypatch.context() as patch:
        patch.setattr(sys, "stderr", stream)
        patch.setattr(logging.root, "handlers", [])
        found, log = os.fstat(stream.fileno()), logging.getLogger("slipd")
        open_log({"JOURNAL_STREAM": f"{found.st_dev}:{found.st_ino}"}, str(journal.path))
        fields = {"slipd_stream": "left.pad"}
        for message in ["%s: failed\n"] * (BURST + 1):
            log.error(message, "left.pad", exc_info=OSError("a\x1b"), extra=fields)
        entries = [journal.entry() for _ in range(BURST)]
        journal.path.unlink()
        log.info("gone")
        logging.root.handlers[0].close()
        stream.seek(0)
        assert stream.read() == "<6>slipd: gone\n"
    assert {entry["MESSAGE"] for entry in entries} == {"slipd: left.pad: failed\\n\n  OSError: a\\x1b"}
    assert {(entry["PRIORITY"], entry["SLIPD_FINGER"]) for entry in entries} == {("3", "left")}


def test_every_fault_of_the_log_is_explained() -> None:
    known = set(re.findall("^## (.+)$", (DOCS / "health.md").read_text(encoding="utf-8"), re.MULTILINE))
    sources = "".join(path.read_text(encoding="utf-8") for path in sorted(DAEMON.rglob("*.py")))
    logged = set(re.findall(r'slipd_fault(?:": |=)"([^"]+)"', sources))
    assert logged
    assert logged <= known
