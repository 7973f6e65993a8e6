"""``slipctl relay``: messages on a TCP port of this machine, for programs that cannot open the daemon's own socket.

PlotJuggler's ZeroMQ source is such a program: its version 4 adds a port to every address, so it cannot open ``ipc``,
and it takes the time of a message from a third frame. Version 3 reads the time from ``timestamp`` in the message, and
a third frame breaks it. The relay only publishes; requests do not cross it.
"""

from __future__ import annotations

import contextlib
import ipaddress
import os
import re
import socket
import sys
import time
from collections import Counter
from typing import TYPE_CHECKING

import zmq

from slipd_client.errors import CallError
from slipd_client.link import Link
from slipd_client.message_tracker import SILENCE_S
from slipd_client.messages import MessageError
from slipd_client.messages.reader import read
from slipd_client.paths import publish_endpoint
from slipd_client.silence_hint import hint_for
from slipd_client.viewers.viewers_arguments import RELAY_LISTEN

if TYPE_CHECKING:
    from slipd_client.keys import Keys

MOST_SUBSCRIPTIONS = 1000
"""Subscriptions of one program; one that has more is disconnected, because ZeroMQ keeps every one of them."""

SUBSCRIPTION_BYTES = 256
"""Longest subscription, bytes; ZeroMQ disconnects a program that sends a longer one."""

_LISTEN = re.compile(r"tcp://(\[[0-9a-fA-F:]+\]|[\d.]+):(\d{1,5}|\*)")


def relay(endpoint: str | None, listen: str, *, keys: Keys | None, time_frame: bool) -> None:
    """Publish every message of the daemon again, until interrupted.

    Args:
        endpoint: Where the daemon publishes; its default when None.
        listen: Where to publish: ``tcp://127.0.0.1:PORT``, port ``*`` is any that is free.
        keys: Keys of this client, for a daemon across a network; None on this machine.
        time_frame: Add a third frame: the time of acquisition in seconds, as text.

    Raises:
        CallError: An endpoint is wrong, or ``listen`` is in use or beyond this machine.
    """
    _check(listen)
    source = Link(zmq.SUB, publish_endpoint() if endpoint is None else endpoint, keys)
    try:
        source.socket.setsockopt(zmq.SUBSCRIBE, b"")
        with zmq.Context() as context, context.socket(zmq.XPUB) as out:
            out.setsockopt(zmq.LINGER, 0)
            out.setsockopt(zmq.MAXMSGSIZE, SUBSCRIPTION_BYTES)
            out.setsockopt(zmq.IPV6, int("[" in listen))
            try:
                out.bind(listen)
            except zmq.ZMQError as error:
                raise CallError(f"cannot publish on {listen}: {error.strerror}") from error
            print(f"relay: {out.getsockopt_string(zmq.LAST_ENDPOINT)}", flush=True)
            _forward(source, out, time_frame=time_frame)
    finally:
        source.close()


def _forward(source: Link, out: zmq.Socket[bytes], *, time_frame: bool) -> None:
    silent = False
    subscriptions: Counter[int] = Counter()
    while True:
        frames = source.receive(time.monotonic() + SILENCE_S)
        _limit_subscriptions(out, subscriptions)
        if frames is None:
            if not silent:
                why = f"no message from {source.endpoint} for {SILENCE_S:g} s. {hint_for(source.endpoint)}"
                print(f"slipctl: {why}", file=sys.stderr, flush=True)
            silent = True
            continue
        silent = False
        if time_frame:
            try:
                seconds = float(read(frames)[1]["timestamp"])
            except (MessageError, KeyError, TypeError):
                continue  # of another version: nobody knows its time
            frames.append(f"{seconds:.6f}".encode())
        out.send_multipart(frames)


def _limit_subscriptions(out: zmq.Socket[bytes], subscriptions: Counter[int]) -> None:
    """Count the subscriptions that arrived, by the descriptor of their connection; end one that has too many."""
    with contextlib.suppress(zmq.Again):
        for _ in range(10 * MOST_SUBSCRIPTIONS):
            frame = out.recv(zmq.NOBLOCK, copy=False)
            try:
                connection = frame.get(zmq.SRCFD)
            except zmq.ZMQError:  # the end of a subscription with its connection
                continue
            subscriptions[connection] += 1 if frame.bytes.startswith(b"\x01") else -1
            if subscriptions[connection] > MOST_SUBSCRIPTIONS:
                del subscriptions[connection]
                with contextlib.suppress(OSError), socket.socket(fileno=os.dup(connection)) as peer:
                    peer.shutdown(socket.SHUT_RDWR)


def _check(listen: str) -> None:
    """Refuse an address that other machines reach: over a network, the daemon serves with keys."""
    match = _LISTEN.fullmatch(listen)
    if match is None:
        raise CallError(f"--listen must be of the form {RELAY_LISTEN}, got {listen!r:.80}")
    try:
        loopback = ipaddress.ip_address(match[1].strip("[]")).is_loopback
    except ValueError as error:
        raise CallError(f"--listen must name an IP address, e.g. {RELAY_LISTEN}: {error}") from error
    if not loopback:
        raise CallError(
            f"--listen must be an address of this machine only, e.g. {RELAY_LISTEN}, got {listen}: over a network, "
            "subscribe to the daemon's own endpoint, with keys"
        )
