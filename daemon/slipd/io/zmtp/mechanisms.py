"""The two security mechanisms of a connection: without keys (NULL), or with a proven key (CURVE).

CURVE is ZeroMQ RFC 26. libsodium provides the primitives; this file implements the sequence. The cookie of the server
is only compared, because the state of a handshake is kept with its connection.
"""

from __future__ import annotations

import secrets
import struct
from collections.abc import Container

from nacl import bindings as sodium
from nacl.exceptions import CryptoError
from zmq.utils import z85

from slipd.io.zmtp.wire import (
    COMMAND,
    MORE,
    ProtocolError,
    decode_metadata,
    encode_command,
    encode_frame,
    encode_metadata,
)

SEAL_BYTES = 33
"""Bytes that CURVE adds to a frame: command name, nonce, authenticator and flags."""

MAX_HANDSHAKE_BYTES = 1024
"""Longest frame of a handshake; INITIATE with the longest identity has about 600 bytes."""

_HELLO_BYTES, _COOKIE_BYTES = 194, 96
_INITIATE_HEAD = _COOKIE_BYTES + 8
_INITIATE_BYTES = 32 + 16 + 80
"""Bytes in the box of INITIATE before the metadata: long-term key, nonce of the vouch, vouch."""

_MESSAGE = b"\x07MESSAGE"
_SEALED_MORE, _SEALED_COMMAND = 0x01, 0x02


class KeyRefusedError(ProtocolError):
    """A key may not connect; `reply` is the answer to the peer."""

    reply = encode_frame(encode_command(b"ERROR", b"\x03400"), COMMAND)


class Null:
    """No keys: every client that reaches the socket may connect.

    Handles the handshake of one connection, and codes its frames afterwards.

    Args:
        socket_type: Socket type of this side, as ZeroMQ names it.

    Attributes:
        name: Name of the mechanism in the greeting.
        properties: Metadata of the peer; empty until the handshake ends.
        key: Key that the peer proved, 40 letters of Z85; b"" without keys.
    """

    name = b"NULL"

    def __init__(self, socket_type: bytes) -> None:
        self.properties: dict[bytes, bytes] = {}
        self.key = b""
        self._own = encode_metadata({b"Socket-Type": socket_type, b"Identity": b""})

    def handshake(self, data: bytes) -> bytes:
        """Handle the data of the next command of the handshake, and return the answer: READY to READY.

        Raises:
            ProtocolError: It is malformed, or does not prove the key.
        """
        self.properties = decode_metadata(data)
        return encode_frame(encode_command(b"READY", self._own), COMMAND)

    def open(self, flags: int, body: bytes) -> tuple[int, bytes]:
        """Return flags and body of a received frame.

        Raises:
            ProtocolError: The peer did not seal this frame.
        """
        return flags, body

    def seal(self, frames: tuple[bytes, ...], flags: int = 0) -> bytes:
        """Encode a message, or with ``COMMAND`` a command, for the wire."""
        data = b""
        for frame in frames[:-1]:
            data += encode_frame(frame, MORE)
        return data + encode_frame(frames[-1], flags)


class Curve(Null):
    """A key on each side, and all frames encrypted.

    Args:
        socket_type: Socket type of this side, as ZeroMQ names it.
        secret: Secret key of the daemon, 32 bytes.
        keys: The keys that may connect, 40 letters of Z85 each.
    """

    name = b"CURVE"

    def __init__(self, socket_type: bytes, secret: bytes, keys: Container[bytes]) -> None:
        super().__init__(socket_type)
        self._secret, self._public = secret, sodium.crypto_scalarmult_base(secret)
        self._keys = keys
        self._client = self._short_secret = b""  # short-term keys: public of the peer, secret of this side
        self._cookie = b""
        self._shared = b""
        self._received = 0  # last nonce of the peer; nonces must increase
        self._sent = 0

    def handshake(self, data: bytes) -> bytes:
        """Answer HELLO with WELCOME, and INITIATE with READY if the key may connect."""
        try:
            return self._initiate(data) if self._cookie else self._hello(data)
        except (CryptoError, RuntimeError) as error:
            raise ProtocolError(
                "a box of the handshake does not open: does the client have the right public key of the daemon?"
            ) from error

    def open(self, flags: int, body: bytes) -> tuple[int, bytes]:
        """Decrypt a frame; accept each frame once and in order."""
        if body[:8] != _MESSAGE or len(body) < SEAL_BYTES:
            raise ProtocolError("a frame is not sealed")
        self._check_nonce(body[8:16])
        try:
            plain = sodium.crypto_box_open_afternm(body[16:], b"CurveZMQMESSAGEC" + body[8:16], self._shared)
        except CryptoError as error:
            raise ProtocolError("a sealed frame does not open") from error
        sealed = plain[0]
        return (MORE if sealed & _SEALED_MORE else 0) | (COMMAND if sealed & _SEALED_COMMAND else 0), plain[1:]

    def seal(self, frames: tuple[bytes, ...], flags: int = 0) -> bytes:
        """Encrypt a message or a command, frame by frame."""
        last = len(frames) - 1
        kind = _SEALED_COMMAND if flags & COMMAND else 0
        return b"".join(
            self._seal_frame(kind | (_SEALED_MORE if number < last else 0), frame)
            for number, frame in enumerate(frames)
        )

    def _seal_frame(self, flags: int, body: bytes) -> bytes:
        nonce = self._next_nonce()
        box = sodium.crypto_box_afternm(bytes((flags,)) + body, b"CurveZMQMESSAGES" + nonce, self._shared)
        return encode_frame(_MESSAGE + nonce + box)

    def _hello(self, data: bytes) -> bytes:
        if len(data) != _HELLO_BYTES or data[:2] != b"\x01\x00":
            raise ProtocolError("the HELLO of the handshake is not that of CURVE 1.0")
        self._client, nonce, box = data[74:106], data[106:114], data[114:]
        self._check_nonce(nonce)
        opening = sodium.crypto_box_beforenm(self._client, self._secret)
        sodium.crypto_box_open_afternm(box, b"CurveZMQHELLO---" + nonce, opening)
        public, self._short_secret = sodium.crypto_box_keypair()
        self._shared = sodium.crypto_box_beforenm(self._client, self._short_secret)
        self._cookie = secrets.token_bytes(_COOKIE_BYTES)
        long_nonce = secrets.token_bytes(16)
        welcome = sodium.crypto_box_afternm(public + self._cookie, b"WELCOME-" + long_nonce, opening)
        return encode_frame(encode_command(b"WELCOME", long_nonce + welcome), COMMAND)

    def _initiate(self, data: bytes) -> bytes:
        if not secrets.compare_digest(data[:_COOKIE_BYTES], self._cookie):
            raise ProtocolError("the INITIATE of the handshake has another cookie")
        nonce = data[_COOKIE_BYTES:_INITIATE_HEAD]
        self._check_nonce(nonce)
        plain = sodium.crypto_box_open_afternm(data[_INITIATE_HEAD:], b"CurveZMQINITIATE" + nonce, self._shared)
        if len(plain) < _INITIATE_BYTES:
            raise ProtocolError("the INITIATE of the handshake is truncated")
        client, vouch_nonce, vouch = plain[:32], plain[32:48], plain[48:_INITIATE_BYTES]
        vouched = sodium.crypto_box_open(vouch, b"VOUCH---" + vouch_nonce, client, self._short_secret)
        if vouched != self._client + self._public:
            raise ProtocolError("the key of the peer does not vouch for this connection")
        key = z85.encode(client)
        if key not in self._keys:
            raise KeyRefusedError(f"key {key.decode()} is not allowed")
        self.properties = decode_metadata(plain[_INITIATE_BYTES:])
        self.key = key
        nonce = self._next_nonce()
        ready = sodium.crypto_box_afternm(self._own, b"CurveZMQREADY---" + nonce, self._shared)
        return encode_frame(encode_command(b"READY", nonce + ready), COMMAND)

    def _check_nonce(self, nonce: bytes) -> None:
        """Refuse a nonce that is not above the last one: a repeated or older frame."""
        number = int.from_bytes(nonce, "big")
        if number <= self._received:
            raise ProtocolError("a nonce was used before")
        self._received = number

    def _next_nonce(self) -> bytes:
        self._sent += 1
        return struct.pack(">Q", self._sent)
