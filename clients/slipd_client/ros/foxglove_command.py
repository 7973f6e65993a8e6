"""``slipctl serve foxglove``: serves messages as ROS 2 messages over Foxglove's WebSocket protocol, or writes layouts.

Clients: Foxglove, Lichtblick, and PlotJuggler's source "Foxglove Bridge". They subscribe and read; the server, which is
the library of its makers, offers nothing else, so no request reaches the daemon.
"""

from __future__ import annotations

import argparse
import sys
import threading
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any, cast

import foxglove

from slipd_client.arguments import ListenAddress
from slipd_client.errors import CallError, Silence
from slipd_client.keys import Keys
from slipd_client.ros import layouts
from slipd_client.ros.conversion import (
    DIAGNOSTICS_TOPIC,
    TYPES,
    PadFrames,
    RosMessage,
    encode,
    pads_of,
    read_config,
    ros_messages,
    schema,
    stale_diagnostics,
)
from slipd_client.ros.layouts import Levels
from slipd_client.ros.slipd_types import time_of
from slipd_client.subscriber import Subscriber

NAME = "slipd"
_SILENCE = "silence"
"""Id of the status that reports a silent daemon."""


class ViewerServer:
    """A server, from its creation until `stop`. A slow client loses messages; it delays nobody.

    A client that subscribes gets the last message of the topic at once, with its own time.

    Args:
        host: Address to listen on.
        port: Port; 0 is any that is free.
        pads: Places of the pads; None: they are not known, and ``/tf`` is not published.

    Raises:
        CallError: The address cannot be used.
    """

    def __init__(self, host: str, port: int, pads: PadFrames | None = None) -> None:
        self._pads = pads
        self._lock = threading.Lock()  # subscriptions arrive on threads of the library
        self._channels: dict[str, Any] = {}
        self._last: dict[str, tuple[int, RosMessage]] = {}
        self._context = foxglove.Context()
        try:
            self._server: Any = foxglove.start_server(
                name=NAME, host=host, port=port, context=self._context, server_listener=cast("Any", self)
            )
        except RuntimeError as error:
            raise CallError(f"cannot serve viewers on {host}:{port}: {error}") from error

    @property
    def port(self) -> int:
        """The port in use."""
        return int(self._server.port)

    @property
    def watched(self) -> bool:
        """A client has subscribed to something."""
        return any(channel.has_sinks() for channel in self._channels.values())

    def publish(self, topic: str, body: Mapping[str, Any]) -> None:
        """Send a message of the daemon to the clients that subscribed to what is made of it."""
        log_ns = time.time_ns()
        for message in ros_messages(topic, body, self._pads):
            self._log(log_ns, message)

    def restart(self) -> None:
        """Forget every last message: they are of an earlier run of the daemon."""
        with self._lock:
            self._last.clear()

    def silent(self, why: str) -> None:
        """Report that the daemon is silent: to clients that are connected, and in ``/diagnostics`` to all.

        Nobody gets a last message any more: it no longer describes the present.
        """
        self._server.publish_status(why, foxglove.websocket.StatusLevel.Warning, _SILENCE)
        last = self._last.get(DIAGNOSTICS_TOPIC)
        self.restart()
        if last is not None:
            log_ns = time.time_ns()
            header = {"stamp": time_of(log_ns), "frame_id": ""}
            self._log(log_ns, last[1]._replace(value=stale_diagnostics(last[1].value, header, why)))

    def alive(self) -> None:
        """Take back the report of `silent`."""
        self._server.remove_status([_SILENCE])

    def stop(self) -> None:
        """End the server and its connections."""
        self._server.stop()

    def on_subscribe(self, client: Any, channel: Any) -> None:
        """Send the last message of a ROS topic to a client; the library calls it, on its own threads."""
        with self._lock:
            if channel.topic in self._last:
                log_ns, message = self._last[channel.topic]
                self._channels[channel.topic].log(encode(message), log_time=log_ns, sink_id=client.id)

    def on_unsubscribe(self, client: Any, channel: Any) -> None:
        """Do nothing; the library calls it."""

    def _log(self, log_ns: int, message: RosMessage) -> None:
        channel = self._channels.get(message.topic) or self._open(message)
        with self._lock:
            self._last[message.topic] = log_ns, message
            if channel.has_sinks():
                channel.log(encode(message), log_time=log_ns)

    def _open(self, message: RosMessage) -> Any:
        text = foxglove.Schema(
            name=TYPES[message.type].full_name, encoding="ros2msg", data=schema(message.type).encode()
        )
        channel = foxglove.Channel(message.topic, schema=text, message_encoding="cdr", context=self._context)
        self._channels[message.topic] = channel
        return channel


def run(chosen: argparse.Namespace, keys: Keys | None) -> None:
    """Carry out the command.

    Raises:
        CallError: An argument is wrong, or a file cannot be read or written.
    """
    if chosen.write_layouts is not None:
        for path in layouts.write(chosen.write_layouts, chosen.fingers, levels_of(chosen.config)):
            print(path)
        return
    pads = None if chosen.config is None else pads_of(chosen.config)
    listen: ListenAddress = chosen.listen
    with Subscriber(chosen.publish, ("",), keys=keys) as subscriber:
        server = ViewerServer(listen.host, listen.port, pads)
        try:
            print(f"foxglove: ws:{listen.url(server.port).removeprefix('http:').rstrip('/')}", flush=True)
            if not listen.loopback:
                print(f"slipctl: every program that reaches port {server.port} can read every message", file=sys.stderr)
            _serve(subscriber, server)
        finally:
            server.stop()


def _serve(subscriber: Subscriber, server: ViewerServer) -> None:
    silent = False
    for arrived in subscriber.follow(idle=lambda: not server.watched):
        if isinstance(arrived, Silence):
            if not silent:
                print(f"slipctl: {arrived}", file=sys.stderr, flush=True)
                server.silent(str(arrived))
        else:
            if silent:
                server.alive()
            if arrived.restarted:
                server.restart()
            server.publish(arrived.topic, arrived.raw)
        silent = isinstance(arrived, Silence)


def levels_of(path: Path | None) -> Levels:
    """Return the levels of a config of the daemon; its defaults without a config.

    Raises:
        CallError: The file cannot be read, or its levels are not numbers.
    """
    stated = {} if path is None else read_config(path).get("levels", {})
    given = {name: stated[name] for name in ("caution", "warning") if name in stated}
    if not all(type(value) in (int, float) for value in given.values()):
        raise CallError(f"{path}: caution and warning of [levels] must be numbers; check it: slipd check")
    return Levels(**given) if path is None else Levels(**given, origin=path.name)
