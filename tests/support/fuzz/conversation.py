"""A device's emulator and its session on one line; the decoder, where the device is not spoken to."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

from slipd.devices import DEVICES, Decoder
from slipd.tools.sim.emulators import make_emulator
from slipd.types.samples import Sample

STEP_NS = 1_000_000


class Conversation:
    """What both say to each other from the opening on.

    Args:
        device: Name of the device.
        seed: Seed of the emulator.
        carried: What the line makes of a piece of bytes, in both directions.

    Attributes:
        now_ns: Time since the opening.
        heard: Every piece that the device said.
    """

    def __init__(self, device: str, seed: int, carried: Callable[[bytes], bytes] = bytes) -> None:
        known = DEVICES[device]
        self.emulator = make_emulator(device, seed)
        self.host = None if known.session is None else known.session(**self.emulator.options)
        self._listener: Decoder = self.host or known.decoder(**self.emulator.options)
        self._carried = carried
        self.now_ns = 0
        self.heard: list[bytes] = []
        self.emulator.opened(0)
        self._written = b"" if self.host is None else self.host.start(0)
        if known.inquiry is not None and (inquiry := known.inquiry(**self.emulator.options)) is not None:
            self.heard.append(self.emulator.inquire(inquiry.request))
            self._listener.receive(self.heard[0], 0)

    def step(self) -> Iterator[Sequence[Sample]]:
        """Let a millisecond pass, and yield the samples of each piece that has some."""
        self.now_ns += STEP_NS
        said = self.emulator.receive(self._carried(self._written), self.now_ns) if self._written else []
        for piece in (*said, *self.emulator.advance(self.now_ns)):
            self.heard.append(piece)
            if samples := self._listener.receive(self._carried(piece), self.now_ns):
                yield samples
        self._written = b"".join(self._commands())

    def _commands(self) -> Iterator[bytes]:
        while self.host is not None and (due_ns := self.host.next_deadline()) is not None and due_ns <= self.now_ns:
            chunk = self.host.on_time(self.now_ns)
            if not chunk and self.host.next_deadline() == due_ns:
                return
            yield chunk
