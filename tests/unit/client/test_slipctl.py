from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from slipd_client.grip import GripClient, Lease
from slipd_client.keys import create
from slipd_client.slipctl import main

if TYPE_CHECKING:
    from conftest import Daemon

Start = Callable[..., "subprocess.Popen[str]"]

PATIENCE_S = 60.0

ENVELOPE = {"v", "id", "op", "boot", "deadline_ns", "arrived_ns"}


@pytest.mark.parametrize(
    ("arguments", "error"),
    [
        (
            [],
            "slipctl: error: COMMAND must be one of watch, view, viewers, relay, ros2, bridge, fleet, status, "
            "diagnose, grip, tare, friction, gravity, commission, object, record, keys\n",
        ),
        (["tare"], "slipctl tare: error: COMMAND must be one of take, get, undo\n"),
        (["keys"], "slipctl keys: error: COMMAND must be one of new, list, show\n"),
    ],
)
def test_a_missing_command_names_the_commands(
    arguments: list[str], error: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as end:
        main(arguments)
    assert end.value.code == 2
    assert capsys.readouterr().err.endswith(error)


@pytest.mark.parametrize("command", [["object"], ["friction"], ["grip", "close"], ["tare", "take"]])
def test_help_is_in_words_of_the_command_line(command: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main([*command, "--help"])
    assert "nil" not in capsys.readouterr().out


def test_help_and_wrong_arguments_need_no_zeromq() -> None:
    code = "import sys; from slipd_client.slipctl import main; main(sys.argv[1:])"
    for arguments in (["--help"], ["grip", "set", "-1"], ["keys", "new", "--help"]):
        check = f"import atexit, sys; atexit.register(lambda: print('zmq' in sys.modules, file=sys.stderr)); {code}"
        done = subprocess.run([sys.executable, "-c", check, *arguments], capture_output=True, text=True, check=False)
        assert done.stderr.endswith("False\n")


@pytest.mark.parametrize("command", [["status"], ["tare", "take", "left"], ["grip", "set", "5"]])
def test_without_a_daemon_every_request_fails_with_a_clear_line(
    requests: str, command: list[str], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(GripClient.__init__.__kwdefaults__, "timeout_s", 0.05)
    assert main(["--requests", requests, *command]) == 1
    shown = capsys.readouterr()
    assert shown.out == ""
    assert shown.err == (f"slipctl: nobody accepts requests at {requests}; nothing was sent. Is slipd running?\n")


def test_the_process_exits_with_1_when_no_daemon_answers(requests: str, slipctl: Start) -> None:
    process = slipctl("--requests", requests, "status")
    _, errors = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 1
    assert "Is slipd running" in errors
    assert "Traceback" not in errors


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["fly"], "invalid choice"),
        (["grip", "5"], "invalid choice"),
        (["grip", "set"], "FORCE_N"),
        (["grip", "set", "lots"], "must be a number, got 'lots'"),
        (["grip", "set", "nan"], "finite"),
        (["grip", "set", "inf"], "finite"),
        (["grip", "set", "-5"], "must be at least 0, got -5"),
        (["tare", "take", "left", "--seconds", "11"], "must be above 0 and at most 10, got 11"),
        (["tare", "get", "left", "--stream", "all"], "invalid choice"),
        (["grip", "set", "5", "--hold", "-1"], "--hold"),
        (["grip", "adjust", "nan"], "finite"),
        (["grip", "open", "--width-m", "wide"], "--width-m"),
        (["grip", "close", "5", "--speed-mps", "0"], "--speed-mps"),
        (["tare", "left", "4"], "invalid choice"),
        (["tare"], "COMMAND"),
        (["tare", "take", "left", "--seconds", "0"], "--seconds"),
        (["friction", "left", "slippery"], "must be a number, got 'slippery'"),
        (["friction", "left", "0.5", "--samples", "2"], "--samples and --patience are for measuring"),
        (["friction", "left", "0.5", "--patience", "0"], "with MU_S the friction is set, not measured"),
        (["record"], "COMMAND must be one of start, stop"),
        (["--requests", "nowhere", "status"], "'nowhere'"),
        (["--publish", "tcp://robot", "watch"], "'tcp://robot'"),
        (["--key", "me.key_secret", "status"], "--server-key"),
        (["--key", "me.key_secret", "--server-key", "slipd.key", "status"], "me.key_secret"),
        (["keys", "new", "no name"], "'no name'"),
    ],
)
def test_a_wrong_call_exits_with_2_and_says_why(
    arguments: list[str], complaint: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    assert ended.value.code == 2
    assert complaint in capsys.readouterr().err


def test_the_public_half_in_place_of_the_secret_one_is_recognised(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    public, _ = create("robot-1", tmp_path)
    with pytest.raises(SystemExit) as ended:
        main(["--key", str(public), "--server-key", str(public), "status"])
    assert ended.value.code == 2
    complaint = f"{public}: must hold a secret key (.key_secret), but holds only the public key"
    assert complaint in capsys.readouterr().err


def test_a_refusal_is_told_with_code_field_and_message(daemon: Daemon, capsys: pytest.CaptureFixture[str]) -> None:
    daemon.handlers["grip.set"] = lambda _: {
        "error": {"code": "out_of_range", "message": "at most 40 N", "field": "force_n"}
    }
    assert main(["--requests", daemon.endpoint, "grip", "set", "99"]) == 1
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
    lines = capsys.readouterr().out.splitlines()
    assert max(map(len, lines)) <= 100
    text = " ".join(" ".join(lines).split())
    assert text.startswith(
        f"1 to repair error stream-silent left.wrench: {long} slipctl status --json each is explained"
    )
    assert "slipd 0.1.0 up – lease –" in text
    assert "left STABLE" in text
    assert text.endswith(long), "broken into lines, and nothing of it is cut"


def test_status_as_json_is_the_whole_map(daemon: Daemon, capsys: pytest.CaptureFixture[str]) -> None:
    status = {"version": "0.1.0", "lease": {"held": False, "expires_in_s": None}}
    daemon.handlers["status"] = lambda _: status
    assert main(["--requests", daemon.endpoint, "status", "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == status | {"repairs": []}


def test_tare_prints_what_was_taken(daemon: Daemon, capsys: pytest.CaptureFixture[str]) -> None:
    daemon.handlers["tare"] = lambda request: {"verified": True, "seconds": request["seconds"]}
    daemon.handlers["tare.get"] = lambda _: {"tare_id": 4, "busy": False}
    assert main(["--requests", daemon.endpoint, "tare", "take", "left", "--seconds", "0.5"]) == 0
    assert capsys.readouterr().out == "tare_id: 4\nbusy: false\nverified: true\n"
    assert daemon.asked[0]["seconds"] == 0.5


def test_tare_takes_the_stream_that_is_named(daemon: Daemon, capsys: pytest.CaptureFixture[str]) -> None:
    daemon.handlers["tare"] = lambda _: {"verified": True, "tare_ids": {"wrench": 0, "pad": 0}}
    daemon.handlers["tare.get"] = lambda _: {"tare_id": 1, "busy": False}
    assert main(["--requests", daemon.endpoint, "tare", "left", "all"]) == 0
    assert '"pad": {"tare_id": 1, "busy": false}' in capsys.readouterr().out
    assert [request.get("stream") for request in daemon.asked] == ["all", "wrench", "pad"]


def test_friction_is_asked_for_without_the_lease_where_another_client_holds_it(
    daemon: Daemon, capsys: pytest.CaptureFixture[str]
) -> None:
    """A stricter value needs none; a more lenient one is refused by the daemon."""
    held = {"error": {"code": "lease_held", "message": "another client holds the lease"}}
    daemon.handlers["lease.acquire"] = lambda _: held
    daemon.handlers["friction.set"] = lambda _: {"mu": 0.3}
    assert main(["--requests", daemon.endpoint, "friction", "left", "0.3"]) == 0
    assert capsys.readouterr().out == "mu: 0.3\n"
    assert daemon.asked_ops == ["lease.acquire", "friction.set"]
    daemon.handlers["friction.set"] = lambda _: {"error": {"code": "no_lease", "message": "acquire the lease first"}}
    assert main(["--requests", daemon.endpoint, "friction", "left", "0.9"]) == 1
    assert capsys.readouterr().err == "slipctl: no_lease: acquire the lease first\n"


def test_a_result_without_fields_is_done(daemon: Daemon, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--requests", daemon.endpoint, "grip", "stop"]) == 0
    assert capsys.readouterr().out == "done\n"


def test_grip_takes_a_lease_sets_the_force_and_releases(daemon: Daemon) -> None:
    assert main(["--requests", daemon.endpoint, "grip", "set", "5.5"]) == 0
    assert [op for op in daemon.asked_ops if op != "lease.renew"] == ["lease.acquire", "grip.set", "lease.release"]
    assert daemon.asked[1]["force_n"] == 5.5


@pytest.mark.parametrize(
    ("arguments", "op", "fields"),
    [
        (["grip", "adjust", "-1.5"], "grip.adjust", {"delta_n": -1.5}),
        (["grip", "hold"], "grip.hold", {}),
        (["grip", "close", "4"], "gripper.close", {"force_n": 4.0}),
        (
            ["grip", "close", "4", "--width-m", "0.02", "--speed-mps", "0.1"],
            "gripper.close",
            {"force_n": 4.0, "width_m": 0.02, "speed_mps": 0.1},
        ),
        (["grip", "open"], "gripper.open", {}),
        (["grip", "open", "--drop", "--width-m", "0.08"], "gripper.open", {"drop": True, "width_m": 0.08}),
        (["grip", "activate"], "gripper.activate", {}),
        (["grip", "activate", "--drop"], "gripper.activate", {"drop": True}),
        (["grip", "stop"], "gripper.stop", {}),
        (["grip", "ack"], "fault.ack", {}),
        (["tare", "get", "left"], "tare.get", {"finger": "left"}),
        (["tare", "undo", "left"], "tare.undo", {"finger": "left"}),
        (["tare", "get", "left", "--stream", "wrench"], "tare.get", {"finger": "left", "stream": "wrench"}),
        (["tare", "undo", "left", "pad"], "tare.undo", {"finger": "left", "stream": "pad"}),
        (["friction", "left", "0.5"], "friction.set", {"finger": "left", "mu_s": 0.5}),
        (["friction", "left", "0.5", "0.4"], "friction.set", {"finger": "left", "mu_s": 0.5, "mu_d": 0.4}),
        (["object", "mug"], "object.set", {"name": "mug"}),
        (["object", "--none"], "object.set", {"name": None}),
        (["record", "start"], "record.start", {}),
        (["record", "stop"], "record.stop", {}),
    ],
)
def test_each_command_sends_its_op_and_prints_the_result(
    daemon: Daemon, capsys: pytest.CaptureFixture[str], arguments: list[str], op: str, fields: dict[str, Any]
) -> None:
    tare = {"tare_id": 3, "busy": False} if op.startswith("tare.") else {}
    daemon.handlers[op] = lambda _: tare | {"done": True}
    assert main(["--requests", daemon.endpoint, *arguments]) == 0
    asked = next(request for request in daemon.requests if request["op"] == op)
    assert {name: asked[name] for name in asked if name not in ENVELOPE} == fields
    assert capsys.readouterr().out == ("tare_id: 3\nbusy: false\n" if tare else "") + "done: true\n"
    leased = op.startswith(("grip", "fault", "friction", "object", "tare.undo"))
    assert [each for each in daemon.ops if each.startswith("lease") and each != "lease.renew"] == (
        ["lease.acquire", "lease.release"] if leased else []
    )


@pytest.fixture
def renewed_often(often: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """The leases of slipctl are renewed often."""
    monkeypatch.setattr(GripClient.lease.__wrapped__, "__defaults__", (often,))


@pytest.mark.usefixtures("renewed_often")
def test_grip_keeps_its_lease_while_it_holds(daemon: Daemon, monkeypatch: pytest.MonkeyPatch) -> None:
    held: list[float] = []

    def wait(lease: Lease, seconds: float) -> None:
        """Hold for as long as two renewals take, however busy the machine is."""
        held.append(seconds)
        until_s = time.monotonic() + PATIENCE_S
        while daemon.ops.count("lease.renew") < 2 and time.monotonic() < until_s:
            time.sleep(0.001)
        lease.check()

    monkeypatch.setattr(Lease, "wait", wait)
    assert main(["--requests", daemon.endpoint, "grip", "set", "5", "--hold", "0.3"]) == 0
    assert held == [0.3]
    assert daemon.asked_ops[0] == "lease.acquire"
    assert daemon.ops[-1] == "lease.release"
    assert daemon.ops.count("lease.renew") >= 2


@pytest.mark.usefixtures("renewed_often")
def test_a_lease_lost_while_holding_is_a_fault(daemon: Daemon, capsys: pytest.CaptureFixture[str]) -> None:
    daemon.handlers["lease.renew"] = lambda _: {"error": {"code": "no_lease", "message": "it has ended"}}
    assert main(["--requests", daemon.endpoint, "grip", "set", "5", "--hold", "30"]) == 1
    assert capsys.readouterr().err.startswith("slipctl: the lease is lost: no_lease: it has ended.")


def test_new_keys_are_files_that_the_next_call_uses(
    daemon: Daemon, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ("robot", "slipd"):
        assert main(["keys", "new", name, "--dir", str(tmp_path)]) == 0
    assert f"{tmp_path}/robot.key_secret" in capsys.readouterr().out
    keys = ["--key", f"{tmp_path}/robot.key_secret", "--server-key", f"{tmp_path}/slipd.key"]
    assert main(["--requests", daemon.endpoint, *keys, "status"]) == 1, "this daemon has no such key"
    assert daemon.ops == []


def test_ctrl_c_while_holding_gives_the_lease_back(daemon: Daemon, slipctl: Start) -> None:
    daemon.handlers["grip.set"] = lambda _: {"force_n": 5.0}
    process = slipctl("--requests", daemon.endpoint, "grip", "set", "5", "--hold", "60")
    assert process.stdout is not None
    assert process.stdout.readline() == "force_n: 5.0\n"
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=PATIENCE_S)
    assert (process.returncode, errors) == (0, "")
    assert daemon.ops[-1] == "lease.release"


def test_ctrl_c_while_waiting_for_an_answer_is_told(daemon: Daemon, slipctl: Start) -> None:
    daemon.handlers["tare"] = lambda _: None
    process = slipctl("--requests", daemon.endpoint, "tare", "take", "left", "--seconds", "10")
    while "tare" not in daemon.ops:
        assert process.poll() is None
        time.sleep(0.01)
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=PATIENCE_S)
    assert (process.returncode, errors) == (1, "slipctl: interrupted\n")
