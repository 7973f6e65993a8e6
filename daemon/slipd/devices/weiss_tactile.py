"""What the Weiss tactile controllers share: images in packets with id 0, and questions answered between them.

Both controllers answer with the id of the question, begin every answer with a status word, and go on pushing images
meanwhile.
"""

from __future__ import annotations

import re
import struct
from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slipd.devices.conversation import SILENCE_NS, Conversation, Step, TalkingSession
from slipd.devices.health import DecoderHealth
from slipd.devices.weiss import PREAMBLE, Packet, Packets, encode, status_word
from slipd.samples import TactileSample

FRAME = 0x00
"""Id of a packet that carries an image."""

RLE = 0x01
"""Flag of an image, and of a request for images: run-length encoded."""

MAX_CELLS = 2048
"""Of one image: four times the six matrices of the SDH hand. It bounds what a wrong length makes wait for."""

FULL_SCALE = 4095
"""The converters have 12 bits."""

_FRAME_HEAD = struct.Struct("<IB")  # timestamp in ms, flags
_HEADS = re.compile(PREAMBLE[:1] + b"(?=" + PREAMBLE[1:] + b"(.)(..))", re.DOTALL)  # id and size, wherever they stand
_CELL_BYTES = 2
_MS_SPAN = 1 << 32
_STATUS_BYTES = 2

PAUSE_NS = 300_000_000
"""The bytes of one packet follow each other: after so long a pause a new one begins."""

Units = NDArray[np.uint16]


def encode_frame(units: Units, device_time_ms: int, seed: int, *, flags: int = 0) -> bytes:
    """Return a packet with an image.

    Args:
        units: Cells, or runs of cells, integers of 16 bits, shape (any,).
        device_time_ms: The controller's clock, ms; sent modulo 2^32.
        seed: Of the checksum, as of `weiss.encode`.
        flags: Of the image.
    """
    head = _FRAME_HEAD.pack(device_time_ms % _MS_SPAN, flags)
    return encode(FRAME, head + np.asarray(units).astype("<u2").tobytes(), seed)


class TactileDecoder(ABC):
    """Finds images and answers; what an image may hold and what is made of it is the device's own.

    ``device_time_ns`` is the controller's millisecond clock as sent: it wraps every 2^32 ms (49.7 days). Images carry
    no number, so `health.lost`, `health.duplicates` and `health.restarts` stay 0: gaps and restarts show in the
    device's time.

    Args:
        seed: Of the checksum.
        replies: Length of the payload of each answer by its id; one of the status word alone is an answer as well.
        typical: Length of an ordinary packet, bytes.
        text: Bytes that are no damage when they stand between packets.
    """

    def __init__(self, seed: int, replies: Mapping[int, int], typical: int, text: bytes = b"") -> None:
        self.health = DecoderHealth()
        self.reply_sizes = replies
        self.replies: list[Packet] = []
        """What the last bytes answered to a session."""
        self._seed = seed
        self._stream = Packets(seed, self._admits, typical, self.health, text=text)

    def receive(self, data: bytes, t_ns: int) -> list[TactileSample]:
        """Take bytes received at ``t_ns`` and return the images they complete."""
        samples: list[TactileSample] = []
        self.replies = []
        for packet in self._stream.packets(data):
            if packet.id == FRAME:
                time_ms, flags = _FRAME_HEAD.unpack_from(packet.payload)
                samples += self._images(bool(flags & RLE), _units(packet.payload), t_ns, time_ms * 1_000_000)
            else:
                self.replies.append(packet)
        self.health.good += len(samples)
        return samples

    def forget(self) -> None:
        """Drop a begun packet: the rest of it will not come."""
        self._stream.forget()

    def _admits(self, packet_id: int, size: int, begun: bytes) -> bool:
        return self._fits(packet_id, size, begun) and not self._swallows(begun)

    def _swallows(self, begun: bytes) -> bool:
        """Say whether a payload holds a whole packet: its length lies, and would make those that follow wait."""
        for head in _HEADS.finditer(begun):
            packet_id, size = head[1][0], int.from_bytes(head[2], "little")
            payload = begun[head.end(2) :][:size]
            whole = encode(packet_id, payload, self._seed)
            if begun.startswith(whole, head.start()) and self._fits(packet_id, size, payload):
                return True
        return False

    def _fits(self, packet_id: int, size: int, begun: bytes) -> bool:
        if packet_id != FRAME:
            return size in (_STATUS_BYTES, self.reply_sizes.get(packet_id)) and packet_id in self.reply_sizes
        count, odd = divmod(size - _FRAME_HEAD.size, _CELL_BYTES)
        if odd or not 0 < count <= MAX_CELLS:
            return False
        if len(begun) < _FRAME_HEAD.size:
            return True
        return self._admits_image(bool(begun[_FRAME_HEAD.size - 1] & RLE), count, _units(begun))

    @abstractmethod
    def _admits_image(self, rle: bool, count: int, begun: Units) -> bool:
        """Say whether an image of ``count`` units may begin with those that have come."""

    @abstractmethod
    def _images(self, rle: bool, units: Units, t_ns: int, device_time_ns: int) -> list[TactileSample]:
        """Make samples of the units of an admitted image."""


def _units(payload: bytes) -> Units:
    count = (len(payload) - _FRAME_HEAD.size) // _CELL_BYTES
    return np.frombuffer(payload, "<u2", count, _FRAME_HEAD.size)


def image(cells: Units, t_ns: int, device_time_ns: int, full_scale: int, source: str = "") -> TactileSample:
    """Make the sample of one matrix; "saturated" where a cell is at full scale."""
    status = ("saturated",) if bool((cells >= full_scale).any()) else ()
    return TactileSample(t_ns, device_time_ns, cells.astype(np.float64), status, source)


@dataclass(frozen=True, slots=True, kw_only=True)
class Question(Step):
    """One question of a session.

    Attributes:
        reply_id: Id of question and answer.
        take: ``take(payload)`` uses the answer, and returns what is wrong with it, "" when nothing is.
        forgives: Status numbers other than 0 with which the answer will do.
    """

    reply_id: int
    take: Callable[[bytes], str] = lambda _: ""
    forgives: Collection[int] = ()


class TactileSession(TalkingSession[TactileSample]):
    """Asks the device what it is, starts its images, and begins anew when they cease.

    Images that arrive are handed on at all times, whatever the state. `state` is "closed", "waiting" (for the first
    answer), "configuring", "waiting for images", "running", or names what is in the way, such as "no answer to sensor"
    or "refused start: access denied"; both are retried for ever.

    Args:
        decoder: Of the images and answers.
        questions: The questions; the last one starts the images.
        stop: Request that stops the images.
        words: Meaning of the device's status numbers.
        period_ns: Expected time from one image to the next.
    """

    decoder: TactileDecoder

    def __init__(
        self,
        decoder: TactileDecoder,
        questions: list[Question],
        stop: bytes,
        words: tuple[str, ...],
        period_ns: int,
    ) -> None:
        silence_ns = max(SILENCE_NS, 3 * period_ns)
        super().__init__(decoder, Conversation(questions, rest_ns=0, silence_ns=silence_ns), stop)
        self._questions = questions
        self._words = words
        self._heard_ns = 0

    def receive(self, data: bytes, now_ns: int) -> list[TactileSample]:
        """Take bytes received at ``now_ns`` and return the images they complete."""
        if now_ns - self._heard_ns > PAUSE_NS:
            self.decoder.forget()
        self._heard_ns = now_ns
        return super().receive(data, now_ns)

    def _hear(self, now_ns: int) -> None:
        asked = next(question for question in self._questions if question.name == self._talk.asked)
        for answer in self.decoder.replies:
            if not self._talk.asked or answer.id != asked.reply_id:
                continue
            wrong = self._take(asked, answer.payload)
            self._talk.answered(now_ns, wrong)
            if not wrong and asked is self._questions[-1]:
                self._talk.state = "waiting for images"

    def _take(self, asked: Question, payload: bytes) -> str:
        """Use an answer; return what is wrong with it, "" when nothing is."""
        code = int.from_bytes(payload[:_STATUS_BYTES], "little")
        if code and code not in asked.forgives:
            return f"refused {asked.name}: {status_word(code, self._words)}"
        if len(payload) != self.decoder.reply_sizes[asked.reply_id]:
            return f"empty answer to {asked.name}"
        return asked.take(payload)
