"""Asks the host of a link's address over TCP what its stream does not tell, such as a sensor's calibration."""

from __future__ import annotations

import asyncio

from slipd.devices import Inquiry
from slipd.errors import LinkError
from slipd.transport.address import host_and_port

TIMEOUT_S = 2.0
"""For the whole of question and answer: a device that is well takes some milliseconds."""

MAX_REPLY_BYTES = 65_536
"""Longest answer without a given length: several times a sensor's page of settings."""


async def inquire(address: str, inquiry: Inquiry) -> bytes:
    """Put the question and return the whole answer.

    Raises:
        LinkError: There is none within TIMEOUT_S, it is cut short or beyond all measure, or its check finds a fault.
    """
    host, _ = host_and_port(address)
    try:
        async with asyncio.timeout(TIMEOUT_S):
            answer = await _ask(host, inquiry)
        fault = inquiry.check(answer)
    except TimeoutError:
        fault = f"no answer within {TIMEOUT_S:g} s"
    except asyncio.IncompleteReadError as error:
        fault = f"{len(error.partial)} bytes of the {inquiry.reply_bytes} of an answer"
    except (OSError, ValueError) as error:
        fault = str(error)
    if not fault:
        return answer
    raise LinkError(
        f"{address}: asked on TCP port {inquiry.port} before it is read: {fault}; switch the device on, correct the"
        " address, or give in the options of the device what it would answer"
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
                raise ValueError(f"an answer of more than {MAX_REPLY_BYTES} bytes")
        if not answer:
            raise ValueError("it hung up without an answer")
        return answer
    finally:
        writer.transport.abort()  # nothing is left to be sent, and nobody waits
