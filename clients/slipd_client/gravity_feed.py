"""``slipctl gravity``: sends the direction of gravity in the frame of a pad, once, repeated, or from a file or pipe."""

from __future__ import annotations

import argparse
import itertools
import math
import os
import select
import stat
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

from slipd_client.errors import CallError, RequestRefused
from slipd_client.grip import GripClient
from slipd_client.keys import Keys
from slipd_client.messages.replies import GravityReply
from slipd_client.quaternions import STANDARD_DOWN, conjugate, rotated, unit

PERIOD_S = 0.1
"""Time between two requests, s: an orientation is valid for 0.25 s, and a client may send 50 requests per second."""

FOLLOW_S = 1.0
"""How long a line of a file or pipe is repeated unless another time is given, s: a robot program that hangs must not
make the daemon believe that the arm stands still."""

OBSTACLE_S = 3.0
"""The daemon may refuse for so long, because the machine is busy."""

LONGEST_LINE = 10_000
READ_BYTES = 65_536


def gravity_of(numbers: Sequence[float]) -> list[float]:
    """Return gravity in the frame of a pad, m/s².

    Args:
        numbers: Three: gravity itself, m/s². Four: the orientation of the pad in a frame whose Z points up, as a unit
            quaternion x, y, z, w that takes coordinates of the pad to that frame.

    Raises:
        CallError: There are neither three nor four finite numbers, or the quaternion is no unit quaternion.
    """
    if len(numbers) not in (3, 4) or not all(map(math.isfinite, numbers)):
        raise CallError(
            "an orientation must be three numbers (gravity in the pad frame, m/s²) or four (orientation of the pad, "
            f"unit quaternion x y z w), got {' '.join(map(str, numbers))!r:.60}"
        )
    if len(numbers) == 3:
        return list(numbers)
    return [each + 0.0 for each in rotated(conjugate(unit(numbers, "the orientation")), STANDARD_DOWN)]


def parse_line(line: str) -> list[float] | None:
    """Return the numbers of a line, separated by blanks or commas; None for an empty line or a comment (#).

    Raises:
        CallError: The line has something else.
    """
    text = line.partition("#")[0]
    return parse_gravity(text) if text.replace(",", " ").strip() else None


def parse_gravity(text: str) -> list[float]:
    """Return gravity from the numbers of a text, separated by blanks or commas, as `gravity_of` takes them.

    Raises:
        CallError: The text has something else.
    """
    try:
        numbers = [float(word) for word in text.replace(",", " ").split()]
    except ValueError:
        raise CallError(f"a line must have three or four numbers, got {text.strip()!r:.60}") from None
    return gravity_of(numbers)


def run(chosen: argparse.Namespace, keys: Keys | None) -> GravityReply | None:
    """Carry out the command; return the last reply, or None if there was no line to follow.

    Raises:
        CallError: The arguments do not go together, an orientation is wrong, or the file cannot be read.
    """
    if (chosen.follow is None) == (not chosen.numbers):
        raise CallError("gravity needs either three or four numbers, or --follow FILE")
    if chosen.follow is None:
        vectors, hold_s = iter([[gravity_of(chosen.numbers)]]), 0.0
    else:
        vectors, hold_s = followed(chosen.follow), FOLLOW_S
    with GripClient(chosen.requests, keys=keys) as client:
        return send(client, chosen.finger, vectors, hold_s if chosen.hold is None else chosen.hold)


def send(client: GripClient, finger: str, vectors: Iterator[list[list[float]]], hold_s: float) -> GravityReply | None:
    """Send the newest vector at 10 Hz, each for ``hold_s`` and at least once; return the last reply.

    Args:
        client: Sends the requests.
        finger: Name of the finger.
        vectors: Gravity in the frame of the pad, m/s²: what is new, every PERIOD_S.
        hold_s: How long a vector is repeated until the next, s.

    Raises:
        RequestRefused: The daemon refuses; that the machine is busy is tolerated for OBSTACLE_S.
    """
    gravity: list[float] | None = None
    reply: GravityReply | None = None
    since_s = well_s = time.monotonic()
    for new in itertools.chain(vectors, _pauses()):
        if new:
            gravity, since_s = new[-1], time.monotonic()
        held = time.monotonic() - since_s < hold_s
        if gravity is not None and (new or held or reply is None):
            try:
                answer = client.gravity_set(finger, gravity)
            except RequestRefused as error:
                if error.code != "deadline_passed" or time.monotonic() - well_s > OBSTACLE_S:
                    raise
                continue
            if reply is None and answer.get("gravity") == "none":
                text = f"the config gives finger {finger} no mass_kg: no weight is subtracted"
                print(f"slipctl: {text}", file=sys.stderr)
            reply, well_s = answer, time.monotonic()
        if new is None and not (gravity and held):
            break
    return reply


def _pauses() -> Iterator[None]:
    while True:
        time.sleep(PERIOD_S)
        yield None


def followed(source: str) -> Iterator[list[list[float]]]:
    """Yield the vectors of the lines that are new in a file or pipe, every PERIOD_S; end with the pipe.

    Args:
        source: Path; "-": standard input.

    Raises:
        CallError: The file cannot be read, or one of its lines is wrong.
    """
    try:
        path = sys.stdin.fileno() if source == "-" else Path(source).expanduser()
        file = open(path, "rb", buffering=0, closefd=source != "-")  # noqa: SIM115 - also of a descriptor
    except (OSError, ValueError) as error:
        why = getattr(error, "strerror", None) or error
        raise CallError(f"--follow must name a file or pipe that can be read, got {source!r}: {why}") from None
    with file:
        grows, part = stat.S_ISREG(os.fstat(file.fileno()).st_mode), b""
        while True:
            ready = select.select([file], [], [], PERIOD_S)[0]
            data = file.read(READ_BYTES) if ready else b""
            ended = bool(ready) and not data and not grows
            *lines, part = (part + (b"\n" if ended else data)).split(b"\n")
            if len(part) > LONGEST_LINE:
                raise CallError(f"--follow: a line must have at most {LONGEST_LINE} bytes")
            found = (parse_line(line.decode(errors="replace")) for line in lines)
            yield [vector for vector in found if vector is not None]
            if ended:
                return
            if ready and not data:
                time.sleep(PERIOD_S)
