"""Entries of the journal, on a real datagram socket, and the lines that it reads from standard error."""

from __future__ import annotations

import io
import logging
import os
import re
import socket
import struct
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from project import DAEMON, DOCS

from slipd.io.host.journal import JournalHandler, PriorityFormatter, is_journal


def record(level: int = logging.WARNING, message: str = "gone", **fields: object) -> logging.LogRecord:
    made = logging.LogRecord("slipd.io.transport.link", level, "link.py", 12, message, (), None, "_report_down")
    made.__dict__.update(fields)
    return made


@pytest.fixture
def journal(tmp_path: Path) -> Iterator[socket.socket]:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as receiver:
        receiver.bind(str(tmp_path / "journal"))
        receiver.settimeout(10.0)
        yield receiver


@pytest.fixture
def lines() -> io.StringIO:
    return io.StringIO()


@pytest.fixture
def handler(tmp_path: Path, lines: io.StringIO) -> Iterator[JournalHandler]:
    fallback = logging.StreamHandler(lines)
    fallback.setFormatter(PriorityFormatter(logging.Formatter("%(message)s")))
    made = JournalHandler(str(tmp_path / "journal"), fallback)
    yield made
    made.close()


def read(entry: bytes) -> dict[str, str]:
    """Return the fields of an entry, decoded by the documented rules of the protocol."""
    found = {}
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


def test_an_entry_has_fields(journal: socket.socket, handler: JournalHandler, lines: io.StringIO) -> None:
    handler.handle(record(slipd_stream="left.wrench", slipd_fault="stream-missing"))
    assert read(journal.recv(65536)) == {
        "MESSAGE": "gone",
        "PRIORITY": "4",
        "SYSLOG_IDENTIFIER": "slipd",
        "LOGGER": "slipd.io.transport.link",
        "CODE_FILE": "link.py",
        "CODE_LINE": "12",
        "CODE_FUNC": "_report_down",
        "SLIPD_FINGER": "left",
        "SLIPD_STREAM": "left.wrench",
        "SLIPD_FAULT": "stream-missing",
    }
    assert lines.getvalue() == ""


def test_a_stream_without_a_finger_has_none(journal: socket.socket, handler: JournalHandler) -> None:
    handler.handle(record(slipd_stream="gripper"))
    assert "SLIPD_FINGER" not in read(journal.recv(65536))


def test_no_value_can_add_a_field(journal: socket.socket, handler: JournalHandler) -> None:
    text = "one\nPRIORITY=0\nSLIPD_FAULT=none\n"
    handler.handle(record(message=text, slipd_recording=f"/tmp/{text}"))
    entry = read(journal.recv(65536))
    assert (entry["MESSAGE"], entry["PRIORITY"]) == (text, "4")
    assert entry["SLIPD_RECORDING"] == "/tmp/" + text.replace("\n", "\\n")
    assert "SLIPD_FAULT" not in entry


def test_what_the_journal_does_not_take_is_written_with_its_priority(
    tmp_path: Path, journal: socket.socket, handler: JournalHandler, lines: io.StringIO
) -> None:
    handler.handle(record(message="x" * 10_000_000))
    assert lines.getvalue() == "<4>" + "x" * 10_000_000 + "\n"
    lines.truncate(0)
    lines.seek(0)
    journal.close()
    (tmp_path / "journal").unlink()
    handler.handle(record(logging.ERROR))
    assert lines.getvalue() == "<3>gone\n"


def test_every_line_has_its_priority() -> None:
    formatter = PriorityFormatter(logging.Formatter("%(message)s"))
    levels = {logging.DEBUG: 7, logging.INFO: 6, logging.WARNING: 4, logging.ERROR: 3, logging.CRITICAL: 2}
    assert [formatter.format(record(level)) for level in levels] == [f"<{number}>gone" for number in levels.values()]
    assert formatter.format(record(message="a\nb")) == "<4>a\n<4>b"


def test_the_journal_is_known_by_the_file_behind_the_stream(tmp_path: Path) -> None:
    with (tmp_path / "stream").open("w", encoding="utf-8") as stream:
        found = os.fstat(stream.fileno())
        assert is_journal(stream, {"JOURNAL_STREAM": f"{found.st_dev}:{found.st_ino}"})
        assert not is_journal(stream, {"JOURNAL_STREAM": f"{found.st_dev}:{found.st_ino + 1}"})
        assert not is_journal(stream, {})
    assert not is_journal(stream, {"JOURNAL_STREAM": "1:2"})


STARTED_BY_SYSTEMD = """
import logging, os, sys
from slipd.io.log_lines import open_log
found = os.fstat(2)
open_log({"JOURNAL_STREAM": f"{found.st_dev}:{found.st_ino}"}, sys.argv[1])
try:
    raise OSError("a\\x1b")
except OSError:
    logging.getLogger("slipd").exception("%s: failed\\n", "left.pad", extra={"slipd_stream": "left.pad"})
"""


def test_a_process_whose_errors_the_journal_reads_sends_entries(tmp_path: Path, journal: socket.socket) -> None:
    command = [sys.executable, "-c", STARTED_BY_SYSTEMD, str(tmp_path / "journal")]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stderr == ""
    entry = read(journal.recv(65536))
    first, *more = entry["MESSAGE"].split("\n")
    assert first == r"slipd: left.pad: failed\n"
    assert more[-1] == r"  OSError: a\x1b"
    assert (entry["PRIORITY"], entry["SLIPD_FINGER"]) == ("3", "left")


def test_every_fault_of_the_log_is_explained() -> None:
    known = set(re.findall("^## (.+)$", (DOCS / "health.md").read_text(encoding="utf-8"), re.MULTILINE))
    sources = "".join(path.read_text(encoding="utf-8") for path in sorted(DAEMON.rglob("*.py")))
    logged = set(re.findall(r'slipd_fault(?:": |=)"([^"]+)"', sources))
    assert logged
    assert logged <= known
