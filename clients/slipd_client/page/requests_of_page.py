"""Carries out what people request on the page: the zero of a finger, small changes of the grip force, and touches.

A request is that of any client of the daemon, and the daemon judges it by its rules. A touch goes to the pads of
``slipd emulate`` by the local socket that ``slipd touch`` uses too, and the emulation checks every value. The page can
ask for nothing else.
"""

from __future__ import annotations

import asyncio
import json
import math
from pathlib import Path
from typing import Any, TypedDict

from websockets.asyncio.server import ServerConnection

from slipd_client.aio import AsyncGripClient
from slipd_client.errors import RequestRefused, SlipdClientError
from slipd_client.grip import GripClient
from slipd_client.keys import Keys

SOCKET = "hand"
"""Name of the socket in the folder of an emulation."""

OK, ERROR = "ok", "error: "
"""Beginnings of the last line of an answer."""

RAMP_S = 0.1
"""Time in which a press reaches its force: a fingertip is no hammer."""

LOOK_S, ANSWER_S = 0.2, 2.0
"""How often to look whether the emulation runs, and how long it may take to answer."""


class EmulatedHand:
    """The hand of one emulation, which may end and begin again. Each command has a connection of its own.

    Args:
        folder: Folder of the emulation, as for ``slipd touch``.

    Attributes:
        fingers: Fingers that can be touched, as of the last `find_fingers`; empty while no emulation runs.
    """

    def __init__(self, folder: Path) -> None:
        self.fingers: tuple[str, ...] = ()
        self.path = folder / SOCKET

    async def find_fingers(self) -> tuple[str, ...]:
        """Ask for the fingers that can be touched now, and return them; a late answer changes nothing."""
        try:
            shown = await self._ask("show")
        except TimeoutError:
            return self.fingers
        except OSError:
            shown = []
        self.fingers = tuple(line.partition(":")[0] for line in shown[:-1])
        return self.fingers

    async def send_fingers(self, connection: ServerConnection) -> None:
        """Send a browser the names of the fingers that can be touched, now and whenever they change."""
        sent: tuple[str, ...] | None = None
        while True:
            if (fingers := await self.find_fingers()) != sent:
                sent = fingers
                await connection.send(json.dumps({"hand": sent}))
            await asyncio.sleep(LOOK_S)

    async def touch(self, text: str) -> Reply:
        """Set what the hand does to one finger; force 0 lets go.

        Args:
            text: JSON with ``finger``, ``force_n``, ``place_mm`` and ``push_n`` (each X and Y of the pad frame), and
                ``twist_mnm``.
        """
        try:
            line = _command(json.loads(text), self.fingers)
        except (ValueError, TypeError, KeyError, OverflowError, RecursionError):
            return refused("the page sent no touch that is understood")
        try:
            last = (await self._ask(line))[-1]
        except OSError:
            return refused("the emulation has ended, or does not answer; start it: slipd emulate CONFIG")
        return {"ok": True, "text": ""} if last == OK else refused(last.removeprefix(ERROR))

    async def _ask(self, line: str) -> list[str]:
        """Return the lines of the answer to a command.

        Raises:
            TimeoutError: The emulation does not answer.
            OSError: No emulation runs, or it answers something else.
        """
        reader, writer = await asyncio.open_unix_connection(self.path)
        try:
            writer.write(f"{line}\n".encode())
            return await asyncio.wait_for(_answer(reader), ANSWER_S)
        except asyncio.TimeoutError as error:  # no OSError under Python 3.10
            raise TimeoutError("no answer") from error
        except ValueError as error:
            raise ConnectionError("no answer") from error
        finally:
            writer.close()


async def _answer(reader: asyncio.StreamReader) -> list[str]:
    """Return the lines up to the one that ends an answer.

    Raises:
        ConnectionError: The connection ended before.
        ValueError: A line is too long.
    """
    lines: list[str] = []
    while data := await reader.readline():
        lines.append(data.decode(errors="replace").rstrip("\n"))
        if lines[-1] == OK or lines[-1].startswith(ERROR):
            return lines
    raise ConnectionError("the emulation has ended")


def _command(touch: dict[str, Any], fingers: tuple[str, ...]) -> str:
    """Return the commands of the emulation for a touch.

    Raises:
        ValueError: The finger is unknown, or a value is not finite.
        OverflowError: A value is too large.
        TypeError: The touch is no map, or a value is of another kind.
        KeyError: A value is missing.
    """
    finger = touch["finger"]
    if finger not in fingers:
        raise ValueError(f"no finger {finger!r}")
    (x_mm, y_mm), (push_x_n, push_y_n) = touch["place_mm"], touch["push_n"]
    force_n, twist_mnm = touch["force_n"], touch["twist_mnm"]
    if not all(math.isfinite(value) for value in (x_mm, y_mm, push_x_n, push_y_n, force_n, twist_mnm)):
        raise ValueError("a value is not finite")
    if force_n == 0.0:
        return f"release {finger}"
    return (
        f"press {finger} {force_n:.3f} N at {x_mm:.2f} {y_mm:.2f} mm in {RAMP_S} s; "
        f"push {finger} {push_x_n:.3f} {push_y_n:.3f} N; twist {finger} {twist_mnm:.2f} mNm"
    )


ADJUST_N = 1.0
"""Change of the grip force on one pad by one press of a button, N."""


class Reply(TypedDict):
    """What became of a request, for people.

    Attributes:
        ok: It was carried out.
        text: What was done; or the daemon's own words where it refused.
    """

    ok: bool
    text: str


def refused(text: str) -> Reply:
    """Return the reply to a request that was not carried out."""
    return {"ok": False, "text": text}


class PageRequests:
    """Sends the requests of the page to one daemon, each with a connection of its own.

    Args:
        endpoint: Where the daemon accepts requests; its default endpoint when None.
        keys: Keys of this client, for a daemon across a network; None on this machine.

    Raises:
        CallError: ``endpoint`` is not a ZeroMQ endpoint.
    """

    def __init__(self, endpoint: str | None, keys: Keys | None = None) -> None:
        self._endpoint = endpoint
        self._keys = keys
        GripClient(endpoint, keys=keys).disconnect()  # a wrong endpoint is an error now, not at the first request

    async def permission(self) -> str:
        """Return why the daemon accepts no request of this client; "" if it may accept some."""
        try:
            async with AsyncGripClient(self._endpoint, keys=self._keys) as client:
                await client.hello()
        except RequestRefused as refusal:
            return str(refusal)
        except SlipdClientError:
            return ""  # no daemon now: a request will say so
        return ""

    async def carry_out(self, text: str) -> Reply:
        """Carry out one request of a page, ``{"do": "tare", "finger": …}`` or ``{"do": "adjust", "delta_n": …}``."""
        try:
            asked = json.loads(text)
            kind, finger, delta_n = asked.get("do"), asked.get("finger"), asked.get("delta_n")
        except (ValueError, AttributeError, RecursionError):  # no JSON, no object, or thousands of "["
            return refused("the page sent no request that is understood")
        try:
            async with AsyncGripClient(self._endpoint, keys=self._keys) as client:
                if kind == "tare" and isinstance(finger, str):
                    return await _tare(client, finger)
                if kind == "adjust" and delta_n in (-ADJUST_N, ADJUST_N):
                    return await _adjust(client, delta_n)
        except SlipdClientError as error:
            return refused(str(error))
        return refused(f"the page may take a tare, and change the grip force by {ADJUST_N:g} N")


async def _tare(client: AsyncGripClient, finger: str) -> Reply:
    result = await client.tare(finger)
    sure = "" if result.verified else "; the daemon does not know whether anything touched the finger"
    taken = ", ".join(f"{stream} (tare {tare.tare_id})" for stream, tare in result.tares.items())
    return {"ok": True, "text": f"{finger}: zero taken of {taken}{sure}"}


async def _adjust(client: AsyncGripClient, delta_n: float) -> Reply:
    async with client.lease():
        result = await client.grip_adjust(delta_n)
    force = "an unknown force" if result.applied_n is None else f"{result.applied_n:.1f} N on each pad"
    return {"ok": True, "text": f"grip force {delta_n:+g} N: the gripper was sent {force}"}
