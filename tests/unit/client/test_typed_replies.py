"""Replies: the map as it arrived, with typed attributes; a reply of another kind is an error."""

from __future__ import annotations

import dataclasses
import json
import types
import typing
from typing import TYPE_CHECKING

import pytest

from slipd_client import client_base
from slipd_client.errors import NoAnswer
from slipd_client.grip import GripClient
from slipd_client.messages import Health
from slipd_client.messages.schema import parts, replies, topics
from slipd_client.messages.schema.ops import OPS
from slipd_client.messages.schema.replies import TareResult
from slipd_client.request_protocol import Steps

if TYPE_CHECKING:
    from conftest import Daemon


def test_a_reply_is_its_map_and_has_its_fields_as_attributes(daemon: Daemon) -> None:
    daemon.handlers["grip.set"] = lambda _: {"applied_n": 5, "later": [1]}
    daemon.handlers["status"] = lambda _: {"version": "0.1.0", "streams": {"left.wrench": {"health": 1}}}
    daemon.handlers["tare"] = lambda _: {"verified": True, "tare_ids": {"wrench": 0}, "tare_id": 0}
    daemon.handlers["tare.get"] = lambda _: {"busy": False, "tare_id": 1, "stream": "wrench", "std": [0.1]}
    with GripClient(daemon.endpoint) as client:
        grip = client.grip_set(5.0)
        assert (grip.applied_n, grip["applied_n"], grip.get("later"), "later" in grip) == (5.0, 5, [1], True)
        assert json.loads(json.dumps(grip)) == grip == {"applied_n": 5, "later": [1]}
        with pytest.raises(dataclasses.FrozenInstanceError):
            grip.applied_n = 7.0  # type: ignore[misc]
        status = client.status()
        assert (status.version, status.streams["left.wrench"].health, status.gripper) == ("0.1.0", Health.WARN, None)
        assert status["streams"]["left.wrench"]["health"] == 1
        tare = client.tare("left", 0.1)
        assert (tare.verified, tare.tares["wrench"].std, tare["std"]) == (True, (0.1,), [0.1])
        assert client.request("grip.set", force_n=5.0).applied_n == 5.0
        assert client.request("later.op") == {}


@pytest.mark.parametrize("applied_n", ["5", True, [5.0]])
def test_a_reply_of_another_kind_is_an_error_that_says_that_the_request_was_carried_out(
    daemon: Daemon, applied_n: object
) -> None:
    daemon.handlers["grip.set"] = lambda _: {"applied_n": applied_n}
    with (
        GripClient(daemon.endpoint) as client,
        pytest.raises(NoAnswer, match=r"carried out grip\.set.*applied_n must be"),
    ):
        client.grip_set(5.0)


@pytest.mark.parametrize("op", OPS)
def test_every_op_has_a_method_that_returns_its_reply(op: str) -> None:
    """The lease has its blocks instead."""
    if op.startswith("lease."):
        assert callable(GripClient.lease)
        return
    method = getattr(GripClient, op.replace(".", "_"))
    returned = typing.get_type_hints(method, vars(client_base))["return"]
    wanted = TareResult if op == "tare" else OPS[op].reply
    assert returned == Steps[wanted]


@pytest.mark.parametrize("module", [parts, replies, topics])
def test_every_class_of_the_wire_is_frozen(module: types.ModuleType) -> None:
    classes = [each for each in vars(module).values() if getattr(each, "__module__", "") == module.__name__]
    classes = [each for each in classes if dataclasses.is_dataclass(each)]
    assert classes
    for each in classes:
        assert each.__dataclass_params__.frozen, each  # type: ignore[attr-defined]
