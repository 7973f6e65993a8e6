"""Calls of slipctl: wrong ones, and each request."""

from __future__ import annotations

import json
import pkgutil
import signal
import subprocess
import sys
from collections.abc import Callable
from importlib import metadata
from typing import Any

import pytest
from client_peers import PATIENCE_S, Daemon, refuse, until

import slipd_client
from slipd_client.grip import Lease
from slipd_client.messages.ops import OPS
from slipd_client.slipctl import COMMANDS

Call = Callable[..., tuple[int, str, str]]


ENVELOPE = {"v", "id", "op", "boot", "deadline_ns", "arrived_ns"}


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (
            [],
            "slipctl: error: COMMAND must be one of watch, view, serve, fleet, status, diagnose, grip, tare, friction, "
            "gravity, object, record, keys\n",
        ),
        (["tare"], "slipctl tare: error: the following arguments are required: take|get|undo\n"),
        (["keys"], "slipctl keys: error: the following arguments are required: new\n"),
        (["serve"], "slipctl serve: error: the following arguments are required: foxglove|ros2|fleet\n"),
        (["stauts"], "slipctl: error: there is no command 'stauts'; did you mean 'status'?\n"),
        (["emulate", "demo"], "slipctl: emulate is a command of slipd: slipd emulate demo\n"),
        (["grip", "5"], "must be one of set, adjust, hold, close, open, activate, stop, ack, got '5'\n"),
        (["grip", "set"], "FORCE_N"),
        (["grip", "set", "lots"], "must be a number, got 'lots'"),
        (["grip", "set", "nan"], "finite"),
        (["grip", "adjust", "inf"], "finite"),
        (["grip", "set", "-5"], "must be at least 0, got -5"),
        (["tare", "take", "left", "--seconds", "11"], "must be above 0 and at most 10, got 11"),
        (["tare", "get", "left", "all"], "invalid choice"),
        (["grip", "set", "5", "--hold", "-1"], "--hold"),
        (["grip", "close", "5", "--speed-mps", "0"], "--speed-mps"),
        (["friction", "set", "left", "slippery"], "must be a number, got 'slippery'"),
        (["friction", "measure", "--samples", "0"], "--samples"),
        (["object", "no name"], "must have 1 to 64 letters"),
        (["gravity", "left"], "gravity needs either three or four numbers, or --follow FILE"),
        (["gravity", "left", "1", "2"], "must be three numbers"),
        (
            ["gravity", "left", "1", "0", "0", "1"],
            "the orientation must be a unit quaternion x y z w, got one of length 1.414",
        ),
        (["gravity", "left", "1", "2", "inf"], "must be finite"),
        (["gravity", "left", "0", "0", "1", "--hold", "-1"], "--hold"),
        (["gravity", "left", "--follow", "/"], "a file or pipe that can be read, got '/': Is a directory\n"),
        (["serve", "foxglove", "--listen", "8765"], "argument --listen: must be HOST:PORT, e.g. 127.0.0.1:"),
        (["serve", "foxglove", "--listen", "localhost:99999"], "must be HOST:PORT"),
        (["serve", "foxglove", "--config", "/nowhere/rig.toml"], "/nowhere/rig.toml: cannot be read: No such file"),
        (["serve", "foxglove", "--fingers", "Left"], "must be the name of a finger, a-z and 0-9, got 'Left'"),
        (["serve", "foxglove", "--write-layouts", "/dev/null/layouts"], "cannot be written: Not a directory"),
        (["--requests", "nowhere", "status"], "'nowhere'"),
        (["watch", "--publish", "tcp://robot"], "'tcp://robot'"),
        (["watch", "--topic", "slips"], "topics must be beginnings of slip.FINGER, warning"),
        (["--key", "me.key_secret", "status"], "--server-key"),
        (["status", "--key", "me.key_secret", "--server-key", "slipd.key"], "me.key_secret: cannot be read"),
        (["keys", "new", "no name"], "'no name'"),
        (["view", "--config", "/nowhere.toml"], "slipctl: /nowhere.toml: there is no such file"),
        (["diagnose", "/dev/null"], "/dev/null: exists, and is not overwritten"),
        (["friction", "left", "0.5"], "COMMAND must be one of measure, set, got 'left'\n"),
    ],
)
def test_a_wrong_call_exits_with_2_and_says_why(arguments: list[str], complaint: str, call: Call) -> None:
    code, out, errors = call(*arguments)
    assert (code, out) == (2, "")
    assert complaint in errors


@pytest.mark.parametrize(
    ("command", "module", "package"),
    [
        ("view", "websockets", "websockets"),
        ("serve foxglove", "foxglove", "foxglove-sdk"),
        ("serve ros2", "cyclonedds", "cyclonedds"),
        ("serve fleet", "zenoh", "eclipse-zenoh"),
        ("fleet", "zenoh", "eclipse-zenoh"),
    ],
)
def test_without_a_package_of_others_a_command_says_what_to_install(
    command: str, module: str, package: str, call: Call, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, module, None)
    missing = f"slipctl: slipctl {command} needs the package {package}: pip install {package}\n"
    assert call(*command.split()) == (2, "", missing)


def test_version_is_that_of_the_package(call: Call) -> None:
    assert call("--version") == (0, f"slipctl {metadata.version('slipd')}\n", "")


@pytest.mark.parametrize("command", ["object", "friction measure", "grip close", "tare take", "serve ros2"])
def test_help_is_in_words_of_the_command_line(command: str, call: Call) -> None:
    code, out, _ = call(*command.split(), "--help")
    assert (code, "nil" in out, "--server-key FILE" in out) == (0, False, True)


@pytest.mark.usefixtures("no_patience")
@pytest.mark.parametrize("command", [["status"], ["tare", "take", "left"], ["grip", "set", "5"]])
def test_without_a_daemon_every_request_fails_with_a_clear_line(requests: str, command: list[str], call: Call) -> None:
    complaint = f"slipctl: nobody accepts requests at {requests}; nothing was sent. Is slipd running?\n"
    assert call(*command, "--requests", requests) == (1, "", complaint)


def test_a_refusal_names_what_to_type_for_the_request_that_it_names(daemon: Daemon, call: Call) -> None:
    daemon.handlers["grip.set"] = refuse(
        "not_active", "request gripper.activate with drop: true; then: slipctl grip ack (fault.ack)"
    )
    typed = "slipctl: not_active: request `slipctl grip activate` with --drop; then: slipctl grip ack\n"
    assert call("--requests", daemon.endpoint, "grip", "set", "5") == (1, "", typed)
    for command in COMMANDS.values():
        assert call(*command.split(), "--help")[0] == 0
    assert set(COMMANDS) <= set(OPS)


def test_status_is_drawn_for_people(daemon: Daemon, call: Call) -> None:
    long = "no reading " * 30 + "at all"
    daemon.handlers["status"] = lambda _: {
        "version": "0.1.0",
        "fingers": {"left": {"level": "stable"}},
        "streams": {"left.wrench": {"health": 3, "message": long}},
    }
    code, out, _ = call("--requests", daemon.endpoint, "status")
    assert (code, max(map(len, out.splitlines())) <= 100) == (0, True)
    text = " ".join(out.split())
    assert text.startswith("slipd 0.1.0 up – lease – left STABLE ")
    assert f"error stream-silent left.wrench: {long} slipctl status --json left.wrench STALE" in text, "nothing is cut"


def test_tare_waits_until_it_is_taken_and_takes_the_stream_that_is_named(daemon: Daemon, call: Call) -> None:
    daemon.handlers["tare"] = lambda request: {"verified": True, "tare_ids": {"wrench": 0, "pad": 0}}
    daemon.handlers["tare.get"] = lambda _: {"tare_id": 4, "busy": False}
    taken = call("--requests", daemon.endpoint, "tare", "take", "left", "--seconds", "0.5")
    assert taken == (0, "tare_id: 4\nbusy: false\nverified: true\n", "")
    assert daemon.asked[0]["seconds"] == 0.5
    _, out, _ = call("--requests", daemon.endpoint, "tare", "left", "all", "--json")
    assert json.loads(out)["streams"]["pad"] == {"tare_id": 4, "busy": False}
    assert [request.get("stream") for request in daemon.asked[2:]] == ["all", "wrench", "pad"]


def test_friction_is_asked_for_without_the_lease_where_another_client_holds_it(daemon: Daemon, call: Call) -> None:
    """A stricter value needs none; a more lenient one is refused by the daemon."""
    daemon.handlers["lease.acquire"] = refuse("lease_held")
    daemon.handlers["friction.set"] = lambda _: {"mu": 0.30000000001, "left": {"μ": [None, 0.12345678]}}
    setting = ("--requests", daemon.endpoint, "friction", "set", "left")
    assert call(*setting, "0.3") == (0, "mu: 0.3\nleft:\n    μ: [null, 0.123457]\n", "")
    assert daemon.asked_ops == ["lease.acquire", "friction.set"]
    daemon.handlers["friction.set"] = refuse("no_lease", "acquire the lease first")
    assert call(*setting, "0.9") == (1, "", "slipctl: no_lease: acquire the lease first\n")


@pytest.mark.parametrize(
    ("arguments", "op", "fields"),
    [
        ("grip set 5.5", "grip.set", {"force_n": 5.5}),
        ("grip set 0", "grip.set", {"force_n": 0.0}),
        ("grip adjust -1.5", "grip.adjust", {"delta_n": -1.5}),
        ("grip hold", "grip.hold", {}),
        ("grip close 4", "gripper.close", {"force_n": 4.0}),
        (
            "grip close 4 --width-m 0.02 --speed-mps 0.1",
            "gripper.close",
            {"force_n": 4.0, "width_m": 0.02, "speed_mps": 0.1},
        ),
        ("grip open", "gripper.open", {}),
        ("grip open --drop --width-m 0.08", "gripper.open", {"drop": True, "width_m": 0.08}),
        ("grip activate --drop", "gripper.activate", {"drop": True}),
        ("grip stop", "gripper.stop", {}),
        ("grip ack", "fault.ack", {}),
        ("tare get left wrench", "tare.get", {"finger": "left", "stream": "wrench"}),
        ("tare undo left pad", "tare.undo", {"finger": "left", "stream": "pad"}),
        ("friction set left 0.5", "friction.set", {"finger": "left", "mu_s": 0.5}),
        ("friction set left 0.5 0.4", "friction.set", {"finger": "left", "mu_s": 0.5, "mu_d": 0.4}),
        ("gravity left 0 0 -9.8", "gravity.set", {"finger": "left", "gravity_mps2": [0.0, 0.0, -9.8]}),
        ("object mug", "object.set", {"name": "mug"}),
        ("object --none", "object.set", {"name": None}),
        ("record start", "record.start", {}),
        ("record stop", "record.stop", {}),
    ],
)
def test_each_command_sends_its_op_and_prints_the_result(
    daemon: Daemon, call: Call, arguments: str, op: str, fields: dict[str, Any]
) -> None:
    reply = {"tare_id": 3, "busy": False} if op.startswith("tare.") else {}
    daemon.handlers[op] = lambda _: reply
    code, out, _ = call(*arguments.split(), "--requests", daemon.endpoint)
    assert (code, out) == (0, "tare_id: 3\nbusy: false\n" if reply else "done\n")
    leased = op.startswith(("grip", "fault", "friction", "object", "tare.undo"))
    assert daemon.asked_ops == (["lease.acquire", op, "lease.release"] if leased else [op])
    asked = daemon.asked[1 if leased else 0]
    assert {name: asked[name] for name in asked if name not in ENVELOPE} == fields
    _, out, _ = call("--requests", daemon.endpoint, *arguments.split(), "--json")
    assert json.loads(out) == reply


@pytest.mark.usefixtures("often")
def test_grip_keeps_its_lease_while_it_holds(daemon: Daemon, call: Call, monkeypatch: pytest.MonkeyPatch) -> None:
    def wait(lease: Lease, seconds: float) -> None:
        """Hold for as long as two renewals take, however busy the machine is."""
        until(lambda: daemon.ops.count("lease.renew") >= 2)
        lease.check()
        assert seconds == 0.3

    monkeypatch.setattr(Lease, "wait", wait)
    assert call("--requests", daemon.endpoint, "grip", "set", "5", "--hold", "0.3")[0] == 0
    assert daemon.asked_ops == ["lease.acquire", "grip.set", "lease.release"]


def test_ctrl_c_while_holding_gives_the_lease_back(
    daemon: Daemon, slipctl: Callable[..., subprocess.Popen[str]]
) -> None:
    daemon.handlers["grip.set"] = lambda _: {"force_n": 5.0}
    process = slipctl("--requests", daemon.endpoint, "grip", "set", "5", "--hold", "60")
    assert process.stdout.readline() == "force_n: 5.0\n"
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=PATIENCE_S)
    assert (process.returncode, errors) == (130, "")
    assert daemon.ops[-1] == "lease.release"


MODULES = [module.name for module in pkgutil.walk_packages(slipd_client.__path__, "slipd_client.")]
HEAVY = "numpy, scipy, numba, pydantic, slipd"


@pytest.mark.parametrize(
    ("modules", "arguments", "not_loaded"),
    [
        (["slipd_client.slipctl"], ["--help"], "zmq"),
        (["slipd_client.slipctl"], ["grip", "set", "-1"], "zmq"),
        (["slipd_client.subscriber", "slipd_client.slipctl_parser"], [], "asyncio"),
        (MODULES, [], HEAVY),
    ],
    ids=["help", "a wrong argument", "a subscriber", "the whole client"],
)
def test_nothing_is_loaded_that_is_not_needed(modules: list[str], arguments: list[str], not_loaded: str) -> None:
    code = f"""
import contextlib, importlib, sys
for name in {modules}:
    importlib.import_module(name)
with contextlib.suppress(SystemExit):
    if {arguments}:
        sys.modules["slipd_client.slipctl"].main({arguments})
print(sorted(set({not_loaded.split(", ")}) & set(sys.modules)))
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "[]"
