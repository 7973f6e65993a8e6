"""``slipctl viewers``: serve the daemon's messages to viewers until interrupted, or write layouts for them."""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from slipd_client.errors import CallError
from slipd_client.message_tracker import SILENCE_S
from slipd_client.ros.pad_frames import PadFrames
from slipd_client.silence_hint import hint_for
from slipd_client.subscriber import Message, Subscriber
from slipd_client.viewers import layouts
from slipd_client.viewers.layouts import Levels
from slipd_client.viewers.viewer_server import ViewerServer

if TYPE_CHECKING:
    from slipd_client.keys import Keys
    from slipd_client.listen_address import ListenAddress

IDLE_S = 0.1
"""Time between two looks at the messages while no viewer has subscribed: most are then never decoded."""


def run(chosen: argparse.Namespace, keys: Keys | None) -> None:
    """Carry out the command.

    Raises:
        CallError: An argument is wrong, a file cannot be read or written, or foxglove-sdk is not installed.
    """
    if chosen.write_layouts is not None:
        for path in layouts.write(chosen.write_layouts, chosen.fingers, levels_of(chosen.config)):
            print(path)
        return
    pads = None if chosen.config is None else pads_of(chosen.config)
    listen: ListenAddress = chosen.listen
    with Subscriber(chosen.publish, ("",), keys=keys, silence_s=None) as subscriber:
        server = ViewerServer(listen.host, listen.port, pads)
        try:
            print(f"viewers: ws:{listen.url(server.port).removeprefix('http:').rstrip('/')}", flush=True)
            if not listen.loopback:
                print(f"slipctl: every program that reaches port {server.port} can read every message", file=sys.stderr)
            _serve(subscriber, server)
        finally:
            server.stop()


def _serve(subscriber: Subscriber, server: ViewerServer) -> None:
    silent = False
    heard_s = time.monotonic()
    while True:
        messages = _arrived(subscriber, watched=server.watched)
        if messages:
            heard_s = time.monotonic()
            if silent:
                server.alive()
            silent = False
        elif not silent and time.monotonic() - heard_s >= SILENCE_S:
            silent = True
            why = f"no message from {subscriber.endpoint} for {SILENCE_S:g} s. {hint_for(subscriber.endpoint)}"
            print(f"slipctl: {why}", file=sys.stderr, flush=True)
            server.silent(why)
        for message in messages:
            if message.restarted:
                server.restart()
            server.publish(message.topic, message.raw)


def _arrived(subscriber: Subscriber, *, watched: bool) -> Sequence[Message]:
    """Wait for messages: for the next one, or, while nobody watches, for the newest of each topic."""
    if watched:
        message = subscriber.receive(SILENCE_S)
        return () if message is None else (message,)
    time.sleep(IDLE_S)
    return subscriber.newest()


def pads_of(path: Path) -> PadFrames:
    """Return the places of the pads in a config of the daemon.

    Raises:
        CallError: The file cannot be read, or has no ``[grasp.pads]``.
    """
    config = _config(path)
    try:
        return PadFrames(config["grasp"]["pads"])
    except (KeyError, TypeError, ValueError) as error:
        raise CallError(
            f"{path}: must have [grasp.pads] with positions and quat_xyzw; check it: slipd check"
        ) from error


def levels_of(path: Path | None) -> Levels:
    """Return the levels of a config of the daemon; its defaults without a config.

    Raises:
        CallError: The file cannot be read, or its levels are not numbers.
    """
    stated = {} if path is None else _config(path).get("levels", {})
    given = {name: stated[name] for name in ("caution", "warning") if name in stated}
    if not all(type(value) in (int, float) for value in given.values()):
        raise CallError(f"{path}: caution and warning of [levels] must be numbers; check it: slipd check")
    return Levels(**given) if path is None else Levels(**given, origin=path.name)


def _config(path: Path) -> dict[str, Any]:
    try:
        import tomllib
    except ModuleNotFoundError as error:  # of Python 3.11
        raise CallError("--config needs Python 3.11 or newer") from error
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise CallError(f"{path}: cannot be read: {error.strerror}") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise CallError(f"{path}: not a TOML file: {error}") from error
