"""``slipctl gravity``: sends the direction of gravity in the frame of a pad, once, repeated, or from a file or pipe."""

from __future__ import annotations

import argparse
import contextlib
import math
import os
import select
import stat
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from slipd_client.errors import CallError, RequestRefused
from slipd_client.grip import GripClient
from slipd_client.keys import Keys
from slipd_client.messages.replies import GravityReply
from slipd_client.quaternions import STANDARD_DOWN, conjugate, rotated

PERIOD_S = 0.1
"""Time between two requests, s: an orientation is valid for 0.25 s, and a client may send 50 requests per second."""

FOLLOW_S = 1.0
"""How long a line of a file or pipe is repeated unless another time is given, s: a robot program that hangs must not
make the daemon believe that the arm stands still."""

OBSTACLE_S = 3.0
"""The daemon may refuse for so long, because the machine is busy."""

UNIT_TOLERANCE = 0.01
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
    length = math.hypot(*numbers)
    if abs(length - 1.0) > UNIT_TOLERANCE:
        raise CallError(
            f"the quaternion must be a unit quaternion in the order x y z w, got one of length {length:.4g}"
        )
    return [each + 0.0 for each in rotated(conjugate([number / length for number in numbers]), STANDARD_DOWN)]


def parse_line(line: str) -> list[float] | None:
    """Return the numbers of a line, separated by blanks or commas; None for an empty line or a comment (#).

    Raises:
        CallError: The line has something else.
    """
    text = line.partition("#")[0]
    return gravity_of(parse_numbers(text)) if text.replace(",", " ").strip() else None


def parse_numbers(text: str) -> list[float]:
    """Return the three or four numbers of a text, separated by blanks or commas.

    Raises:
        CallError: The text has something else.
    """
    try:
        numbers = [float(word) for word in text.replace(",", " ").split()]
    except ValueError:
        numbers = []
    if len(numbers) not in (3, 4):
        raise CallError(f"a line must have three or four numbers, got {text.strip()!r:.60}")
    return numbers


def run(chosen: argparse.Namespace, keys: Keys | None) -> GravityReply | None:
    """Carry out the command; return the last reply, or None if there was no line to follow.

    Raises:
        CallError: The arguments do not go together, an orientation is wrong, or the file cannot be read.
    """
    if (chosen.follow is None) == (not chosen.numbers):
        raise CallError("gravity needs either three or four numbers, or --follow FILE")
    with GripClient(chosen.requests, keys=keys) as client:
        if chosen.follow is not None:
            return follow(client, chosen.finger, chosen.follow, chosen.hold)
        return send(client, chosen.finger, gravity_of(chosen.numbers), chosen.hold or 0.0)


def send(client: GripClient, finger: str, gravity_mps2: Sequence[float], hold_s: float) -> GravityReply:
    """Send a gravity vector, and repeat it for ``hold_s``; return the last reply."""
    feed = _Feed(client, finger)
    until_s = time.monotonic() + hold_s
    while True:
        feed.send(gravity_mps2)
        rest_s = until_s - time.monotonic()
        if rest_s <= 0.0 and feed.reply is not None:
            return feed.reply
        time.sleep(max(min(PERIOD_S, rest_s), 0.0))


def follow(client: GripClient, finger: str, source: str, hold_s: float | None) -> GravityReply | None:
    """Send the newest line of a file or pipe at 10 Hz, until a pipe ends, or for ever for a regular file.

    Args:
        client: Sends the requests.
        finger: Name of the finger.
        source: Path; "-": standard input.
        hold_s: How long a line is repeated until the next; None: FOLLOW_S.

    Returns:
        The last reply; None if there was no line.

    Raises:
        CallError: The file cannot be read, or one of its lines is wrong.
    """
    hold_s = FOLLOW_S if hold_s is None else hold_s
    feed, lines = _Feed(client, finger), _NewLines(source)
    gravity: list[float] | None = None
    since_s = 0.0
    with contextlib.closing(lines):
        while True:
            newest = [found for found in map(parse_line, lines.read(PERIOD_S)) if found is not None]
            if newest:
                gravity, since_s = newest[-1], time.monotonic()
            held = gravity is not None and time.monotonic() - since_s <= hold_s
            if gravity is not None and (newest or held):
                feed.send(gravity)
            if lines.ended and not (held and hold_s):
                return feed.reply


class _Feed:
    """Sends gravity; a refusal of a busy machine is tolerated for a while."""

    def __init__(self, client: GripClient, finger: str) -> None:
        self._client, self._finger = client, finger
        self._well_s = time.monotonic()
        self.reply: GravityReply | None = None

    def send(self, gravity_mps2: Sequence[float]) -> None:
        first = self.reply is None
        try:
            self.reply = self._client.gravity_set(self._finger, gravity_mps2)
        except RequestRefused as error:
            if error.code != "deadline_passed" or time.monotonic() - self._well_s > OBSTACLE_S:
                raise
        else:
            self._well_s = time.monotonic()
            if first and self.reply.get("gravity") == "none":
                text = f"the config gives finger {self._finger} no mass_kg: no weight is subtracted"
                print(f"slipctl: {text}", file=sys.stderr)


class _NewLines:
    """The lines that are appended to a file, or arrive in a pipe."""

    def __init__(self, source: str) -> None:
        try:
            self._fd = os.dup(sys.stdin.fileno()) if source == "-" else os.open(Path(source).expanduser(), os.O_RDONLY)
            os.read(self._fd, 0)  # fails for a folder
        except (OSError, ValueError) as error:
            why = getattr(error, "strerror", None) or error
            raise CallError(f"--follow must name a file or pipe that can be read, got {source!r}: {why}") from None
        self._grows = stat.S_ISREG(os.fstat(self._fd).st_mode)
        self._part = b""
        self.ended = False

    def read(self, patience_s: float) -> list[str]:
        """Return the lines since the last call; wait for at most ``patience_s``."""
        if self.ended:
            time.sleep(patience_s)
            return []
        if not select.select([self._fd], [], [], patience_s)[0]:
            return []
        data = os.read(self._fd, READ_BYTES)
        if not data and self._grows:
            time.sleep(patience_s)
        elif not data:
            self.ended = True
            data = b"\n"
        *lines, self._part = (self._part + data).split(b"\n")
        if len(self._part) > LONGEST_LINE:
            raise CallError(f"--follow: a line must have at most {LONGEST_LINE} bytes")
        return [line.decode(errors="replace") for line in lines]

    def close(self) -> None:
        os.close(self._fd)
