"""The log: lines are escaped, cut and limited, and dropped lines are counted."""

from __future__ import annotations

import logging
import subprocess
import sys
from pathlib import Path

import pytest

from slipd.errors import LONGEST_TEXT, one_line
from slipd.io.log_lines import BURST, EVERY_S, KINDS, LogFormatter, LogGate, log_kept, open_log


def line(message: str, *args: object, name: str = "slipd.io.transport.link") -> logging.LogRecord:
    return logging.LogRecord(name, logging.WARNING, "link.py", 1, message, args, None)


def test_control_characters_are_escaped_and_a_long_text_is_cut() -> None:
    assert one_line("S/N 12 µ") == "S/N 12 µ"
    forged = one_line("bye\nERROR slipd: \x1b[31mall is lost\x85\u2028\u202e")
    assert forged == "bye\\nERROR slipd: \\x1b[31mall is lost\\x85\\u2028\\u202e"
    assert one_line("x" * LONGEST_TEXT) == "x" * LONGEST_TEXT
    assert one_line("x" * 8000) == "x" * LONGEST_TEXT + " … (8000 characters)"
    assert len(one_line("\n" * 8000)) < LONGEST_TEXT + 30


def test_a_line_whose_arguments_do_not_fit_harms_only_itself(capsys: pytest.CaptureFixture[str]) -> None:
    handler = logging.StreamHandler()
    handler.addFilter(LogGate(lambda: 0.0))
    handler.handle(line("%d datagrams lost", "many"))
    assert "Logging error" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("message", "args", "shown"),
    [
        ("%s: %s", ("left.pad", "closed: bye\nERROR forged"), "left.pad: closed: bye\\nERROR forged"),
        ("ready", (), "ready"),
        ("%(name)s", ({"name": "left"},), "left"),
    ],
)
def test_a_passed_line_is_escaped(message: str, args: tuple[object, ...], shown: str) -> None:
    record = line(message, *args)
    assert LogGate(lambda: 0.0).filter(record)
    assert record.getMessage() == shown


def test_lines_of_one_kind_are_limited_and_dropped_lines_are_counted() -> None:
    now_s = [50.0]
    gate = LogGate(lambda: now_s[0])
    passed = [gate.filter(line("%s: %s", "left.pad", f"reason {n}")) for n in range(100)]
    assert passed == [n < BURST for n in range(100)]
    assert gate.filter(line("%s: %s", "right.pad", "another link")), "another link has lines of its own"
    now_s[0] += EVERY_S
    late = line("%s: %s", "left.pad", "reason 100")
    assert gate.filter(late)
    assert late.getMessage() == "left.pad: reason 100 (90 similar lines were dropped)"
    assert not gate.filter(line("%s: %s", "left.pad", "reason 101"))
    now_s[0] += 100 * EVERY_S
    assert sum(gate.filter(line("%s: %s", "left.pad", f"reason {n}")) for n in range(100)) == BURST


def test_the_gate_keeps_a_bounded_number_of_kinds() -> None:
    gate = LogGate(lambda: 0.0)
    assert all(gate.filter(line(f"message {n}")) for n in range(10 * KINDS))
    assert len(gate._limit._buckets) <= KINDS


FORGED = "why\nERROR slipd: \x1b[31mall is lost\x9b\u2028"


def test_no_text_of_an_exception_can_look_like_a_line_of_the_log() -> None:
    error = ValueError(FORGED)
    record = line("%s: failed", "left.pad")
    record.exc_info = type(error), error, None
    assert LogGate(lambda: 0.0).filter(record)
    assert LogFormatter("%(name)s: %(message)s").format(record).split("\n") == [
        "slipd.io.transport.link: left.pad: failed",
        "  ValueError: why",
        r"  ERROR slipd: \x1b[31mall is lost\x9b\u2028",
    ]


UNEXPECTED = f"""
import sys, threading
from slipd.io.log_lines import log_uncaught, open_log
open_log()
log_uncaught()
def fail():
    raise ZeroDivisionError({FORGED!r})
thread = threading.Thread(target=fail)
thread.start()
thread.join()
fail()
"""


def test_an_exception_that_ends_a_thread_or_the_process_is_logged_with_its_text_escaped() -> None:
    done = subprocess.run([sys.executable, "-c", UNEXPECTED], capture_output=True, text=True, check=False)
    assert done.returncode == 1
    for text in (
        "CRITICAL slipd.io.log_lines: ended by an unexpected exception",
        "  ZeroDivisionError: why",
        r"  ERROR slipd: \x1b[31mall is lost\x9b\u2028",
    ):
        assert done.stderr.split("\n").count(text) == 2


def test_where_no_journal_reads_it_the_log_is_kept_in_a_file_too(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """A daemon that was killed leaves its log there, and the next one goes on with it."""
    caplog.set_level(logging.WARNING)  # as before a log is opened; it is restored
    kept, log = tmp_path / "log", logging.getLogger("slipd.a")
    with monkeypatch.context() as patch:
        patch.setattr(logging.root, "handlers", [])
        open_log({})
        for place in (kept, kept, tmp_path):
            with log_kept(place):
                log.warning("gone: %s", "a\nb")
            log.info("after")
            log.debug("unseen")
    shown = "WARNING slipd.a: gone: a\\nb\nINFO slipd.a: after\n"
    refused = f"WARNING slipd.io.log_lines: {tmp_path}: the log is not kept: Is a directory\n"
    assert capsys.readouterr().err == shown + shown + refused + shown
    assert [text[24:] for text in kept.read_text().splitlines()] == ["WARNING slipd.a: gone: a\\nb"] * 2
