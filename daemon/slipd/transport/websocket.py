"""A WebSocket server as a connection: each message it sends is handed on as one piece of bytes."""

from __future__ import annotations

from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed, InvalidURI, WebSocketException

from slipd.errors import LinkError
from slipd.pipeline.events import LinkSpec
from slipd.transport.link import OnBytes

MAX_MESSAGE_BYTES = 1 << 20
"""Largest message taken: some 30 times one image of the largest pads as JSON text."""

MAX_QUEUED_MESSAGES = 16
"""Messages read ahead of the loop; beyond it the server is held back by TCP."""

OPEN_TIMEOUT_S = 3.0
"""A sensor server stands beside the robot: one that takes longer to answer is wedged."""

PING_INTERVAL_S = 1.0
"""How often a silent server is asked for a sign of life."""

PING_TIMEOUT_S = 2.0
"""How long it may take to answer: with the interval, a cut cable is noticed within 3 s."""

CLOSE_TIMEOUT_S = 0.5
"""How long closing waits for the server's farewell."""


async def open_websocket(spec: LinkSpec, on_bytes: OnBytes) -> WebsocketConnection:
    """Connect to a server, past any proxy that the environment names: sensors are not on the web.

    Raises:
        LinkError: It cannot be reached; says why and what would be right.
    """
    try:
        client = await connect(
            spec.address,
            compression=None,
            proxy=None,
            open_timeout=OPEN_TIMEOUT_S,
            ping_interval=PING_INTERVAL_S,
            ping_timeout=PING_TIMEOUT_S,
            close_timeout=CLOSE_TIMEOUT_S,
            max_size=MAX_MESSAGE_BYTES,
            max_queue=MAX_QUEUED_MESSAGES,
        )
    except (InvalidURI, ValueError) as error:
        raise LinkError(f"{spec.address}: no address of a WebSocket server; one is ws://host:5000") from error
    except OSError as error:
        raise LinkError(f"{spec.address}: does not answer ({error}); start the sensor's server there") from error
    except WebSocketException as error:
        raise LinkError(f"{spec.address}: is no WebSocket server ({error}); correct host and port") from error
    return WebsocketConnection(spec.address, client, on_bytes)


class WebsocketConnection:
    """An open connection; see `slipd.transport.link.Connection` for what each method promises."""

    overruns = 0

    def __init__(self, address: str, client: ClientConnection, on_bytes: OnBytes) -> None:
        self.identity = address
        self._client = client
        self._on_bytes = on_bytes

    async def until_lost(self) -> str:
        """Hand on every message; return why there are no more, or raise what the consumer of them raised."""
        while True:
            try:
                data = await self._client.recv(decode=False)
            except ConnectionClosed as error:
                return f"{self.identity}: connection ended ({error}); it is opened again when the server is back"
            self._on_bytes(data)

    def write(self, data: bytes) -> bool:
        """Refuse: the sensors that sit behind a WebSocket server take no commands."""
        del data
        return False

    async def close(self) -> None:
        """Say farewell for at most CLOSE_TIMEOUT_S, then drop the connection."""
        await self._client.close()
