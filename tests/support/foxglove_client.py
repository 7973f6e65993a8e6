"""A client of Foxglove's WebSocket protocol as it is published: https://github.com/foxglove/ws-protocol.

It has no line in common with slipd or with Foxglove's library: `websockets` carries it, `rosbags` decodes.
"""

from __future__ import annotations

import json
import struct
from contextlib import ExitStack
from typing import Any, NamedTuple

from rig_parts import PATIENCE_S
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from websockets.sync.client import connect
from websockets.typing import Subprotocol

_HEAD = struct.Struct("<BIQ")  # opcode, subscription, log time
MESSAGE_DATA = 1


class Received(NamedTuple):
    """One message: its topic, its type, when it was published (ns since 1970), and the message as rosbags has it."""

    topic: str
    type: str
    log_ns: int
    message: Any


class FoxgloveClient(ExitStack):
    """Reads what a server advertises, subscribes, and decodes with nothing but the advertised definitions."""

    def __init__(self, url: str) -> None:
        super().__init__()
        self._socket = self.enter_context(connect(url, subprotocols=[Subprotocol("foxglove.sdk.v1")], max_queue=None))
        self.channels: dict[str, dict[str, Any]] = {}
        self.told: list[dict[str, Any]] = []
        self._topics: dict[int, str] = {}
        self._store = get_typestore(Stores.EMPTY)
        assert self.next_json("serverInfo")["name"] == "slipd"

    def subscribe(self, *topics: str) -> None:
        """Subscribe, as soon as the topics are advertised."""
        while not set(topics) <= set(self.channels):
            self.next_json("advertise")
        channels = [self.channels[topic] for topic in topics]
        for channel in channels:
            self._store.register(get_types_from_msg(channel["schema"], channel["schemaName"]))
            self._topics[1000 + channel["id"]] = channel["topic"]
        added = [{"id": 1000 + channel["id"], "channelId": channel["id"]} for channel in channels]
        self._socket.send(json.dumps({"op": "subscribe", "subscriptions": added}))

    def next_json(self, op: str) -> dict[str, Any]:
        """Return the next text message of a kind."""
        while True:
            text = self._socket.recv(PATIENCE_S)
            if isinstance(text, str) and self._keep(text)["op"] == op:
                return self.told[-1]

    def heard(self, op: str) -> dict[str, Any]:
        """Return the last text message of a kind; wait for one if there was none. Texts may overtake messages."""
        return next((each for each in reversed(self.told) if each["op"] == op), None) or self.next_json(op)

    def receive(self) -> Received:
        """Return the next message of a topic."""
        while True:
            data = self._socket.recv(PATIENCE_S)
            if isinstance(data, str):
                self._keep(data)
                continue
            opcode, subscription, log_ns = _HEAD.unpack_from(data)
            assert opcode == MESSAGE_DATA
            topic = self._topics[subscription]
            kind = self.channels[topic]["schemaName"]
            return Received(topic, kind, log_ns, self._store.deserialize_cdr(data[_HEAD.size :], kind))

    def _keep(self, text: str) -> dict[str, Any]:
        found: dict[str, Any] = json.loads(text)
        self.told.append(found)
        for channel in found.get("channels", ()):
            self.channels[channel["topic"]] = channel
        return found
