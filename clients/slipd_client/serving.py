"""What the commands that serve other programs share: messages until interrupted, and what they read of the config."""

from __future__ import annotations

import importlib
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from slipd_client.errors import CallError, Silence
from slipd_client.ros.conversion import PadFrames
from slipd_client.subscriber import Message, Subscriber

IDLE_S = 0.1
"""Time between two looks at the messages while nobody needs them: most are then never decoded."""


def follow(subscriber: Subscriber, idle: Callable[[], bool] = lambda: False) -> Iterator[Message | Silence]:
    """Yield every message for ever, and a Silence each time that none came for the silence of the subscriber.

    The first Silence in a row is printed on standard error.

    Args:
        subscriber: Receives the messages.
        idle: Whether nobody needs every message now: then the newest of each topic is yielded.
    """
    reported = False
    while True:
        try:
            few = idle()
            for message in _newest(subscriber) if few else subscriber:
                reported = False
                yield message
                if not few and idle():
                    break
        except Silence as silence:
            if not reported:
                print(f"slipctl: {silence}", file=sys.stderr, flush=True)
            reported = True
            yield silence


def _newest(subscriber: Subscriber) -> list[Message]:
    time.sleep(IDLE_S)
    subscriber.check_silence()
    return subscriber.newest()


def pads_of(path: Path) -> PadFrames:
    """Return the places of the pads in a config of the daemon.

    Raises:
        CallError: The file cannot be read, or has no ``[grasp.pads]``.
    """
    config = read_config(path)
    try:
        return PadFrames(config["grasp"]["pads"])
    except (KeyError, TypeError, ValueError) as error:
        raise CallError(
            f"{path}: must have [grasp.pads] with positions and quat_xyzw; check it: slipd check"
        ) from error


def read_config(path: Path) -> dict[str, Any]:
    """Return the tables of a config of the daemon.

    Raises:
        CallError: The file cannot be read.
    """
    try:
        config: dict[str, Any] = importlib.import_module("tomllib").loads(path.read_text(encoding="utf-8"))
    except ModuleNotFoundError as error:  # of Python 3.11
        raise CallError("--config needs Python 3.11 or newer") from error
    except OSError as error:
        raise CallError(f"{path}: cannot be read: {error.strerror}") from error
    except ValueError as error:
        raise CallError(f"{path}: not a TOML file: {error}") from error
    return config
