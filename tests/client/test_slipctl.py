from __future__ import annotations

import json
import signal
import subprocess
import time
from collections.abc import Callable
from typing import TYPE_CHECKING

import pytest

from slipd_client.slipctl import main

if TYPE_CHECKING:
    from conftest import Daemon

Start = Callable[..., "subprocess.Popen[str]"]

PATIENCE_S = 20.0


@pytest.mark.parametrize("command", [["status"], ["tare", "left", "--seconds", "0.1"], ["grip", "5"]])
def test_without_a_daemon_every_request_fails_with_a_clear_line(
    requests: str, command: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["--requests", requests, *command]) == 1
    shown = capsys.readouterr()
    assert shown.out == ""
    assert shown.err == (f"slipctl: nobody takes requests at {requests}; nothing was sent. Is slipd running?\n")


def test_the_process_exits_with_1_when_no_daemon_answers(requests: str, slipctl: Start) -> None:
    process = slipctl("--requests", requests, "status")
    _, errors = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 1
    assert "Is slipd running" in errors
    assert "Traceback" not in errors


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        ([], "required"),
        (["fly"], "invalid choice"),
        (["grip"], "FORCE_N"),
        (["grip", "lots"], "'lots' is no number"),
        (["grip", "nan"], "finite"),
        (["grip", "inf"], "finite"),
        (["grip", "-5"], "finite number from 0 up"),
        (["grip", "0"], "more than 0"),
        (["grip", "5", "--hold", "-1"], "--hold"),
        (["tare", "left", "--seconds", "0"], "--seconds"),
        (["--requests", "nowhere", "status"], "'nowhere'"),
        (["--publish", "tcp://robot", "watch"], "'tcp://robot'"),
    ],
)
def test_a_wrong_call_exits_with_2_and_says_why(
    arguments: list[str], complaint: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    assert ended.value.code == 2
    assert complaint in capsys.readouterr().err


def test_a_refusal_is_told_with_code_field_and_message(daemon: Daemon, capsys: pytest.CaptureFixture[str]) -> None:
    daemon.handlers["grip.set"] = lambda _: {
        "error": {"code": "out_of_range", "message": "at most 40 N", "field": "force_n"}
    }
    assert main(["--requests", daemon.endpoint, "grip", "99"]) == 1
    assert capsys.readouterr().err == "slipctl: out_of_range: force_n: at most 40 N\n"
    assert daemon.ops[-1] == "lease.release"


def test_status_is_drawn_for_people(daemon: Daemon, capsys: pytest.CaptureFixture[str]) -> None:
    long = "no reading " * 30 + "at all"
    daemon.handlers["status"] = lambda _: {
        "version": "0.1.0",
        "fingers": {"left": {"level": "stable"}},
        "streams": {"left.wrench": {"health": 3, "message": long}},
    }
    assert main(["--requests", daemon.endpoint, "status"]) == 0
    first, second, third = capsys.readouterr().out.splitlines()
    assert first.startswith("slipd 0.1.0")
    assert second.startswith("left      STABLE")
    assert third.endswith(long), "no terminal, no cut"


def test_status_as_json_is_the_whole_map(daemon: Daemon, capsys: pytest.CaptureFixture[str]) -> None:
    status = {"version": "0.1.0", "lease": {"held": False, "expires_in_s": None}}
    daemon.handlers["status"] = lambda _: status
    assert main(["--requests", daemon.endpoint, "status", "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == status


def test_tare_prints_what_was_taken(daemon: Daemon, capsys: pytest.CaptureFixture[str]) -> None:
    daemon.handlers["tare"] = lambda request: {"verified": True, "seconds": request["seconds"]}
    daemon.handlers["tare.get"] = lambda _: {"tare_id": 4, "busy": False}
    assert main(["--requests", daemon.endpoint, "tare", "left", "--seconds", "0.5"]) == 0
    assert capsys.readouterr().out == "tare_id: 4\nbusy: false\nverified: true\n"
    assert daemon.requests[1]["seconds"] == 0.5


def test_grip_takes_a_lease_sets_the_force_and_releases(daemon: Daemon) -> None:
    assert main(["--requests", daemon.endpoint, "grip", "5.5"]) == 0
    assert daemon.ops == ["hello", "lease.acquire", "grip.set", "lease.release"]
    assert daemon.requests[2]["force_n"] == 5.5


def test_grip_renews_its_lease_well_in_time_while_it_holds(daemon: Daemon) -> None:
    assert main(["--requests", daemon.endpoint, "grip", "5", "--hold", "0.3"]) == 0
    assert daemon.ops[:3] == ["hello", "lease.acquire", "grip.set"]
    assert daemon.ops[-1] == "lease.release"
    renewals = daemon.ops.count("lease.renew")
    assert len(daemon.ops) == 4 + renewals
    assert renewals >= 2


def test_a_lease_lost_while_holding_is_a_fault(daemon: Daemon, capsys: pytest.CaptureFixture[str]) -> None:
    daemon.handlers["lease.renew"] = lambda _: {"error": {"code": "no_lease", "message": "it has ended"}}
    assert main(["--requests", daemon.endpoint, "grip", "5", "--hold", "30"]) == 1
    assert capsys.readouterr().err == "slipctl: no_lease: it has ended\n"


def test_ctrl_c_while_holding_gives_the_lease_back(daemon: Daemon, slipctl: Start) -> None:
    daemon.handlers["grip.set"] = lambda _: {"force_n": 5.0}
    process = slipctl("--requests", daemon.endpoint, "grip", "5", "--hold", "60")
    assert process.stdout is not None
    assert process.stdout.readline() == "force_n: 5.0\n"
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=PATIENCE_S)
    assert (process.returncode, errors) == (0, "")
    assert daemon.ops[-1] == "lease.release"


def test_ctrl_c_while_waiting_for_an_answer_is_told(daemon: Daemon, slipctl: Start) -> None:
    daemon.handlers["tare"] = lambda _: None
    process = slipctl("--requests", daemon.endpoint, "tare", "left", "--seconds", "60")
    while "tare" not in daemon.ops:
        assert process.poll() is None
        time.sleep(0.01)
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=PATIENCE_S)
    assert (process.returncode, errors) == (1, "slipctl: interrupted\n")
