"""Only publish/ knows the keys of messages and replies; requests/ reads the fields of requests."""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, get_args

import pytest
from project import DAEMON

from slipd.events import Publish, Reply
from slipd.gripper.intent import IntentKind
from slipd_client.messages.schema.ops import OPS
from slipd_client.messages.schema.request_fields import ENVELOPE

Run = Any

#: Rooms with formats of their own: bytes of devices, emulators of devices, recordings, config files.
OTHER_FORMATS = {"devices", "sim", "recording", "config"}
#: Programs that read messages, as every client does.
CLIENTS = {"cli.py", "demo.py"}
#: Rooms that read requests.
READERS = {"requests", "bus"}
REQUEST_FIELDS = {field.name for field in ENVELOPE} | {name for op in OPS.values() for name in op.fields}
#: Keys that are words of their own elsewhere: ops, kinds of intent, and the context of asyncio's exception handler.
ALSO_WORDS = {*OPS, *get_args(IntentKind)}
ASYNCIO = {("service.py", "message")}
GRASP = """
[grasp.pads.left]
positions = [[0.0, 0.0, 0.0, 0.0], [0.085, 0.0, 0.0425, 0.0]]
quat_xyzw = [0.5, -0.5, 0.5, 0.5]
[grasp.pads.right]
positions = [[0.0, 0.0, 0.0, 0.0], [0.085, 0.0, -0.0425, 0.0]]
quat_xyzw = [-0.5, -0.5, -0.5, 0.5]
[reflex]
enabled = true
raise_n_per_s = 100.0
"""
REQUESTS: list[tuple[str, dict[str, Any]]] = [
    ("hello", {}),
    ("tare", {"finger": "left", "seconds": 0.01}),
    ("tare.get", {"finger": "left"}),
    ("gravity.set", {"finger": "left", "gravity_mps2": [0.0, 0.0, -9.8]}),
    ("friction.set", {"finger": "left", "mu_s": 0.4}),
    ("lease.acquire", {"ttl_ms": 200}),
    ("gripper.close", {"force_n": 5.0}),
    ("grip.hold", {}),
    ("fault.ack", {}),
    ("record.start", {}),
    ("record.stop", {}),
    ("status", {}),
    ("unknown", {}),
]


@pytest.fixture
def keys(rig: str, make_run: Callable[[str], Run]) -> set[str]:
    """Keys of the messages and replies of a run in which everything is published and requested."""
    run = make_run(rig + GRASP)
    run.up()
    run.bring_up()
    for op, fields in REQUESTS:
        run.ask(op, **fields)
    run.grip(5.0)
    for _ in range(2):
        run.image()
        run.skin(5.0)
        run.wrench(5.0, (2.4, 0.0))
    bodies = [output.body for _, output in run.out if isinstance(output, Publish | Reply)]
    assert {output.topic.partition(".")[0] for _, output in run.out if isinstance(output, Publish)} == {
        *("slip", "warning", "wrench", "tactile", "grasp", "gripper", "status"),
    }
    return {key for body in bodies for key in keys_of(body)} - {*run.engine.links, "left", "right", "wrench"}


def keys_of(value: Any) -> Iterator[str]:
    """Every key of a body and of the maps within it."""
    if isinstance(value, dict):
        yield from value
        for inner in value.values():
            yield from keys_of(inner)


def literals(node: ast.AST) -> list[ast.expr]:
    """Expressions that a piece of code uses as keys of a map."""
    match node:
        case ast.Dict(keys=found):
            return [key for key in found if key is not None]
        case ast.Subscript(slice=key):
            return [key]
        case ast.Call(func=ast.Attribute(attr="get" | "pop" | "setdefault"), args=[key, *_]):
            return [key]
        case ast.Call(func=ast.Name(id="dict"), keywords=named):
            return [ast.Constant(keyword.arg) for keyword in named]
    return []


def uses(file: Path, keys: set[str]) -> set[tuple[str, str]]:
    """File and key of every use of one of these keys in a file."""
    tree = ast.parse(file.read_text(encoding="utf-8"))
    found = [key for node in ast.walk(tree) for key in literals(node) if isinstance(key, ast.Constant)]
    return {(str(file.relative_to(DAEMON)), key.value) for key in found if key.value in keys}


def test_no_other_room_uses_a_key_of_the_wire(keys: set[str]) -> None:
    stray: set[tuple[str, str]] = set()
    for file in DAEMON.rglob("*.py"):
        room = file.relative_to(DAEMON).parts[0]
        if room in OTHER_FORMATS | CLIENTS | {"publish"}:
            continue
        stray |= uses(file, keys - ALSO_WORDS - (REQUEST_FIELDS if room in READERS else set()))
    assert stray <= ASYNCIO


def test_the_scan_finds_every_key_of_the_wire_in_publish(keys: set[str]) -> None:
    """So the test above would see one elsewhere."""
    found = {key for file in (DAEMON / "publish").rglob("*.py") for _, key in uses(file, keys)}
    assert keys - found == set()
