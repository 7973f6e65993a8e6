"""Ask the host of a link over TCP for what its stream does not contain, such as the calibration of a sensor."""

from __future__ import annotations

import asyncio
import contextlib

from slipd.devices import Inquiry
from slipd.errors import LinkError
from slipd.io.transport.address import host_and_port

TIMEOUT_S = 2.0
"""Longest duration of request and answer, s: a working device takes some milliseconds."""

MAX_REPLY_BYTES = 65_536
"""Longest answer of unknown length: several times the settings page of a sensor."""


async def inquire(address: str, inquiry: Inquiry) -> bytes:
    """Send the request of an inquiry, make the change that the answer calls for, and return the newest whole answer.

    A change that fails is no fault of the link: the answer shows it.

    Raises:
        LinkError: No answer within TIMEOUT_S, an answer that is cut off or too long, or one that fails its check.
    """
    answer = await _checked(address, inquiry)
    if request := inquiry.change(answer):
        with contextlib.suppress(LinkError):
            await _checked(address, Inquiry(inquiry.port, request, 0))
        with contextlib.suppress(LinkError):
            answer = await _checked(address, inquiry)
    return answer


async def _checked(address: str, inquiry: Inquiry) -> bytes:
    host, _ = host_and_port(address)
    try:
        async with asyncio.timeout(TIMEOUT_S):
            answer = await _ask(host, inquiry)
        fault = inquiry.check(answer)
    except TimeoutError:
        fault = f"no answer within {TIMEOUT_S:g} s"
    except asyncio.IncompleteReadError as error:
        fault = f"the answer must have {inquiry.reply_bytes} bytes, got {len(error.partial)}"
    except (OSError, ValueError) as error:
        fault = str(error)
    if not fault:
        return answer
    raise LinkError(
        f"{address}: inquiry on TCP port {inquiry.port} failed: {fault}; switch the device on, correct the address, or"
        " state in the options what the device would answer"
    )


async def _ask(host: str, inquiry: Inquiry) -> bytes:
    reader, writer = await asyncio.open_connection(host, inquiry.port, limit=MAX_REPLY_BYTES)
    try:
        writer.write(inquiry.request)
        if inquiry.reply_bytes:
            return await reader.readexactly(inquiry.reply_bytes)
        answer = b""
        while chunk := await reader.read(MAX_REPLY_BYTES):
            answer += chunk
            if len(answer) > MAX_REPLY_BYTES:
                raise ValueError(f"the answer has more than {MAX_REPLY_BYTES} bytes")
        if not answer:
            raise ValueError("the device closed the connection without an answer")
        return answer
    finally:
        writer.transport.abort()  # nothing is left to send
