"""Common parts of the Weiss tactile controllers (DSACON32m, WTS): images in packets with id 0, and queries.

Both controllers answer with the id of the query, begin every answer with a status (u16), and continue to send images
meanwhile. The payload of an image is device time in ms (u32), flags (u8), and one u16 per cell or run of cells.
"""

from __future__ import annotations

import re
import struct
from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Mapping
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from slipd.devices.shared.frame_scanner import FrameDecoder
from slipd.devices.shared.sensor_session import ATTEMPTS, SILENCE_NS, SensorSession, Step
from slipd.devices.shared.weiss_packets import PREAMBLE, PacketScanner, encode, status_word
from slipd.types.samples import TactileSample

FRAME = 0x00
"""Id of a packet that contains an image."""

RLE = 0x01
"""Flag of an image, and of a request for images: run-length encoded."""

MAX_CELLS = 2048
"""Most cells of an image: four times the six matrices of the SDH hand. It limits the wait after a wrong length."""

FULL_SCALE = 4095
"""The converters have 12 bits."""

_FRAME_HEAD = struct.Struct("<IB")  # device time in ms, flags
_HEADS = re.compile(PREAMBLE[:1] + b"(?=" + PREAMBLE[1:] + b"(.)(..))", re.DOTALL)  # id and size, overlapping matches
_WORD_BYTES = 2
_STATUS_BYTES = 2

Words = NDArray[np.uint16]
"""Cells of an image, or runs of cells."""


class TactileDecoder(FrameDecoder, ABC):
    """Find images and answers; the subclass decides which images are valid and makes samples of them.

    ``device_time_ns`` is the controller's millisecond clock as sent: it wraps every 2^32 ms (49.7 days). Images have no
    sequence number, so `health.lost`, `health.duplicates` and `health.restarts` stay 0: gaps and restarts show in the
    device time.

    Args:
        seed: Seed of the checksum.
        reply_sizes: Payload length of the answer to each query id. An answer may also be a status alone.
        typical: Length of an ordinary packet, bytes.
        text: Bytes that are not counted as damage between packets.
    """

    _frames: PacketScanner

    def __init__(self, seed: int, reply_sizes: Mapping[int, int], typical: int, text: bytes = b"") -> None:
        super().__init__()
        self._reply_sizes = reply_sizes
        self._seed = seed
        self._frames = PacketScanner(seed, self._accepts, typical, self.health, text=text)

    def _readings(self, data: bytes, t_ns: int) -> list[TactileSample]:
        samples: list[TactileSample] = []
        for packet in self._frames.packets(data, t_ns):
            if packet.id == FRAME:
                time_ms, flags = _FRAME_HEAD.unpack_from(packet.payload)
                samples += self._samples(bool(flags & RLE), _words(packet.payload), t_ns, time_ms * 1_000_000)
            else:
                self.replies.append(packet)
        return samples

    def _accepts(self, packet_id: int, size: int, payload: bytes) -> bool:
        return self._fits(packet_id, size, payload) and not self._contains_packet(payload)

    def _contains_packet(self, payload: bytes) -> bool:
        """Return whether a payload contains a whole packet, which means that its own length is wrong."""
        for head in _HEADS.finditer(payload):
            packet_id, size = head[1][0], int.from_bytes(head[2], "little")
            content = payload[head.end(2) :][:size]
            is_whole = len(content) == size and self._fits(packet_id, size, content)
            if is_whole and payload.startswith(encode(packet_id, content, self._seed), head.start()):
                return True
        return False

    def _fits(self, packet_id: int, size: int, payload: bytes) -> bool:
        if packet_id != FRAME:
            return size in (_STATUS_BYTES, self._reply_sizes.get(packet_id)) and packet_id in self._reply_sizes
        count, odd = divmod(size - _FRAME_HEAD.size, _WORD_BYTES)
        if odd or not 0 < count <= MAX_CELLS:
            return False
        if len(payload) < _FRAME_HEAD.size:
            return True
        return self._accepts_image(bool(payload[_FRAME_HEAD.size - 1] & RLE), count, _words(payload))

    @abstractmethod
    def _accepts_image(self, rle: bool, count: int, words: Words) -> bool:
        """Return whether an image of ``count`` words may begin with the words received so far."""

    @abstractmethod
    def _samples(self, rle: bool, words: Words, t_ns: int, device_time_ns: int) -> list[TactileSample]:
        """Return the samples of an accepted image."""


def _words(payload: bytes) -> Words:
    count = (len(payload) - _FRAME_HEAD.size) // _WORD_BYTES
    return np.frombuffer(payload, "<u2", count, _FRAME_HEAD.size)


def matrix_sample(cells: Words, t_ns: int, device_time_ns: int, full_scale: int, source: str = "") -> TactileSample:
    """Return the sample of one matrix, with status "saturated" if a cell is at full scale."""
    status = ("saturated",) if bool((cells >= full_scale).any()) else ()
    return TactileSample(t_ns, device_time_ns, cells.astype(np.float64), status, source)


D = TypeVar("D", bound=TactileDecoder)


class TactileSession(SensorSession[D]):
    """Query the controller, start its images, and start again when they stop.

    `state` is as in `StartupSequence`, such as "refused start: access denied".

    Args:
        decoder: Decoder of images and answers.
        steps: The requests, see `query`; the last one starts the images.
        stop: Request that stops the images.
        period_ns: Expected time from one image to the next.
    """

    answered_state = "waiting for images"

    def __init__(self, decoder: D, steps: list[Step], stop: bytes, period_ns: int) -> None:
        silence_ns = max(SILENCE_NS, 3 * period_ns)
        super().__init__(decoder, steps, stop, rest_ns=0, silence_ns=silence_ns)


def query(
    reply_sizes: Mapping[int, int],
    words: tuple[str, ...],
    name: str,
    request: bytes,
    *,
    handle: Callable[[bytes], str | None] = lambda _: None,
    tolerates: Collection[int] = (),
    attempts: int = ATTEMPTS,
) -> Step:
    """Return a request of a session.

    Args:
        reply_sizes: Payload length of the answer to each id.
        words: Meaning of the device's status numbers.
        name: Its name, for people.
        request: Its packet, whose id is that of the answer.
        handle: ``handle(payload)`` uses the answer, and returns what is wrong with it, "" or None if nothing is.
        tolerates: Status numbers other than 0 that are accepted.
        attempts: Number of times it is sent without an answer.
    """
    reply_id = request[len(PREAMBLE)]

    def check(payload: bytes) -> str | None:
        code = int.from_bytes(payload[:_STATUS_BYTES], "little")
        if code and code not in tolerates:
            return f"refused {name}: {status_word(code, words)}"
        return handle(payload) if len(payload) == reply_sizes[reply_id] else f"empty answer to {name}"

    return Step(name, request, attempts=attempts, reply=reply_id, handle=check)
