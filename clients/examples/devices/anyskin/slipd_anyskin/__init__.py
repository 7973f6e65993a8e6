"""AnySkin and eFlesh boards on USB: the magnetic field at five magnetometers, streamed without a request.

A frame is, for each magnetometer, temperature and field x, y, z as little-endian floats, then CR LF. It has neither
counter nor checksum. Sources: github.com/raunaqbhirangi/anyskin, ``anyskin/sensor.py`` (the frame, 115200 bit/s) and
``arduino/5X_binary_burst_stream`` (the firmware); github.com/tedyapo/arduino-MLX90393, ``MLX90393.h`` (order, µT, °C);
eFlesh uses the same boards (github.com/notvenky/eFlesh, README).

The field is no force: it depends on the skin, its magnets and every magnet nearby, and no source gives a conversion.
So every image has the status "raw": slipd records the field, but concludes nothing from it.
"""

from __future__ import annotations

import numpy as np

from slipd.devices import Device
from slipd.devices.shared.frame_scanner import NO_FRAME, FrameDecoder, FrameScanner
from slipd.types.arrays import Array
from slipd.types.samples import TactileSample

MAGNETOMETERS = 5
END = b"\r\n"

_LARGEST = np.array((1e3, 3e5, 3e5, 3e5), dtype=np.float32)
"""Beyond what the 16-bit converter of a magnetometer can report, °C and µT."""


class Decoder(FrameDecoder):
    """Decode frames into images of the field, shape (magnetometers, 3), µT.

    Args:
        magnetometers: Number of magnetometers on the board.

    Raises:
        ValueError: The number is not from 1 to 16.
    """

    def __init__(self, magnetometers: int = MAGNETOMETERS) -> None:
        if not 1 <= magnetometers <= 16:
            raise ValueError(f"magnetometers must be from 1 to 16, got {magnetometers}")
        super().__init__()
        self._shape = (magnetometers, 4)
        # a frame has no first byte of its own: every place is tried
        self._length = 16 * magnetometers + len(END)
        self._frames = FrameScanner(b"", self._measure, self._length, self.health, least=self._length)

    def _readings(self, data: bytes, t_ns: int) -> list[TactileSample]:
        buffer, found = self._frames.receive(data)
        fields = (self._values(buffer, at)[:, 1:].astype(np.float64) for at, _ in found)
        return [TactileSample(t_ns, None, field_ut, ("raw",)) for field_ut in fields]

    def _measure(self, buffer: bytes, at: int) -> int:
        ends = buffer.startswith(END, at + self._length - len(END))
        return self._length if ends and np.all(np.abs(self._values(buffer, at)) <= _LARGEST) else NO_FRAME

    def _values(self, buffer: bytes, at: int) -> Array:
        """Return temperature and field of each magnetometer in the frame that begins at ``at``."""
        return np.frombuffer(buffer, "<f4", 4 * self._shape[0], at).reshape(self._shape)


def encode_frame(field_ut: np.typing.ArrayLike, temperature_c: float = 25.0) -> bytes:
    """Encode a frame as the board sends it.

    Args:
        field_ut: Field at each magnetometer, shape (magnetometers, 3), µT.
        temperature_c: Temperature of all magnetometers, °C.
    """
    values = np.insert(np.asarray(field_ut, dtype=np.float64), 0, temperature_c, axis=1)
    return values.astype("<f4").tobytes() + END


ABOUT = """\
AnySkin and eFlesh: a skin with magnets over a board with five magnetometers (MLX90393), USB serial.

    [finger.left.pad]
    device = "anyskin"
    package = "slipd-anyskin"
    port = "/dev/serial/by-id/usb-Adafruit_QT_Py_M0-if00"
    rate_hz = 100.0            # MEASURE: `slipctl status` shows the rate
    rows = 1                   # five magnetometers in scan order; the board has them in a cross, which is no grid
    cols = 5
    pitch_m = 0.007
    electrode_m = 0.007
    axis_scale = [1.0, 1.0, 1.0]

What slipd can do: record and replay the field beside everything else, and report a board that falls silent or sends
damaged frames. What it cannot: the field is not a force, so each image is refused as "raw", and a finger with this pad
alone is "unknown". A program that converts the field into forces, such as a trained model, pushes them to the device
`external` instead.

Not shown by the sources: the rate; what the board sends for a magnetometer that does not answer. A damaged value is not
detected, because a frame has no checksum.
"""

DEVICE = Device(
    "anyskin",
    "tactile",
    ("serial",),
    Decoder,
    rates_hz=(1.0, 1000.0),
    baud=115_200,
    axes=3,
    frame="an AnySkin frame",
    evidence="maker",
    emulator="slipd_anyskin.emulator",
    about=ABOUT,
    interface=1,
)
