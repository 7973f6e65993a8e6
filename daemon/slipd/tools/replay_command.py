"""The command ``slipd replay``: print or publish the messages of a recording."""

from __future__ import annotations

import asyncio
import contextlib
import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from slipd.compile_kernels import compile_kernels, interruptible
from slipd.recording.reader import open_recording
from slipd.recording.replay import Pace, replay
from slipd.types.device_text import printable


def replay_command(path: Path, speed: float | None, *, as_json: bool, publish: str | None) -> bool:
    """Replay a recording; print changes of level, or every message as JSON.

    Args:
        path: The recording.
        speed: Recorded seconds per second, which standard error states first; None: as fast as possible.
        as_json: Print every message, one per line.
        publish: Publish the messages too, on this endpoint; "": on that of the recorded config; None: do not.

    Returns:
        Whether the recording is complete.

    Raises:
        ConfigError: The recorded config has faults (for this version of slipd).
        SlipdError: The recording cannot be read, or the endpoint cannot be opened.
    """
    recording = open_recording(path)
    with interruptible():
        messages = replay(recording, on_event=Pace(speed).wait_until) if speed else replay(recording)
        compile_kernels()
    if speed is not None:
        pace = "in real time" if speed == 1.0 else f"at {speed:g} times real time"
        print(f"slipd: replays {pace}; as fast as possible: --speed max", file=sys.stderr, flush=True)
    if publish is not None:
        asyncio.run(_publish(messages, publish or _endpoint(recording.config_text, str(path)), as_json=as_json))
    else:
        for topic, body in messages:
            _print_message(topic, body, as_json=as_json)
    if not recording.complete:
        print(f"slipd: the recording is incomplete: {printable(recording.gap)}", file=sys.stderr)
    return recording.complete


def _endpoint(text: str, file: str) -> str:
    from slipd import config

    return config.parse(text, file).bus.publish or ""


async def _publish(messages: Iterator[tuple[str, dict[str, Any]]], endpoint: str, *, as_json: bool) -> None:
    """Publish a replay; the loop serves subscribers while a thread waits between messages.

    Args:
        messages: Topic and body of every message.
        endpoint: Where to publish; "": where a daemon of this user publishes.
        as_json: Print every message too.
    """
    from slipd.io.bus.publisher import Publisher
    from slipd.io.bus.runtime_directory import RuntimeDirectory
    from slipd_client.messages import encode
    from slipd_client.paths import publish_endpoint, runtime_dir

    with contextlib.ExitStack() as stack:
        if not endpoint:
            stack.enter_context(RuntimeDirectory(runtime_dir()))
        publisher = stack.enter_context(Publisher(endpoint or publish_endpoint()))
        print(f"publish: {publisher.endpoint}", file=sys.stderr if as_json else sys.stdout, flush=True)
        while (message := await asyncio.to_thread(next, messages, None)) is not None:
            publisher.publish(message[0], encode(message[1]))
            _print_message(*message, as_json=as_json)


def _print_message(topic: str, body: dict[str, Any], *, as_json: bool) -> None:
    if as_json:
        print(json.dumps({"topic": topic} | body, ensure_ascii=False, allow_nan=False))
    elif topic == "warning":
        reasons = ", ".join(body["reasons"]) or "none"
        if body["evidence"]:
            reasons += f"; moves by {', '.join(body['evidence'])}"
        print(f"{body['t_ns'] * 1e-9:12.3f} s  {body['finger']}: {body['previous']} → {body['level']} ({reasons})")
