"""Keys that every device stream has, and the types of values that several tables share."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, Strict

from slipd.config.value_bounds import StrictModel

Positive = Annotated[float, Field(gt=0.0)]
NotNegative = Annotated[float, Field(ge=0.0)]

Hertz = Annotated[float, Field(ge=1e-3, le=1e6)]
"""A rate, Hz. No stream is slower than one reading in 1000 s or faster than 1 MHz."""

Point = Annotated[tuple[float, float], Strict(False)]
"""One row of a table, written as a list in TOML, which has no tuples."""

Table = Annotated[list[Point], Field(min_length=2)]
Option = bool | int | float | str | list[float] | list[list[float]]


class Stream(StrictModel):
    """Keys of every device stream.

    Attributes:
        device: Name of the device, as listed in docs/devices.md. Wrong: its bytes are not understood: no reading, and
            `slipctl status` shows what arrives instead.
        package: Package that provides the device, if it is not one of slipd's own; `slipd devices` lists the installed
            ones. "": slipd. Wrong: the config is refused; the error names the package to install.
        port: Path of a serial port, ``tcp://HOST:PORT``, ``udp://HOST:PORT``, ``ws://HOST:PORT``, or the local socket
            (``ipc:///PATH``, ``unix:///PATH``) to which another program connects. Wrong: no reading, or those of
            another device; `slipctl status` shows what arrives.
        sensor: Name of the sensor on a port that carries several; "" where the port carries one. Wrong: the readings of
            the other sensor, or none. Press one finger and look which one reacts.
        hardware_id: Serial number or name that the device reports (`slipctl status` shows it). A device that reports
            another one is refused. "": the first device that answers in a run is accepted. Wrong: the device is
            refused, and its finger is unknown.
        baud: Line speed of a serial port, bit/s; None: the default of the device. Wrong: only damaged frames arrive,
            and the finger is unknown.
        rate_hz: Expected readings per second, within 25 % of the rates of the device, and no more than its line
            carries. Wrong: too low, and a silent sensor is noticed late; too high, and the stream is stale between its
            readings.
        stale_s: A stream without a reading for this long is stale, s; so is a reading older than this on arrival. Time
            in which the daemon itself did not run does not count. None: three periods, at least 20 ms. At least 0.01 s
            or 1.5 periods, at most 0.5 s or 10 periods, the longer of each. Grip raises have a limit of their own. For
            a gripper this affects only the reported health. Wrong: too long, and a dead sensor is noticed late; too
            short, and the finger is often unknown.
        delay_s: Known delay from the acquisition of a reading to its earliest receipt, s, such as a filter delay; below
            ``stale_s``. Wrong: all times are off by the difference, and force and image of a finger do not belong
            together.
        poll_s: Polling period of the line, s, where readings wait for the host to poll and carry no time: 0.001 for
            most USB adapters at 1 kHz. Half of it is subtracted from the time of receipt, and all of it is added to the
            uncertainty of that time. Wrong: times are off by half of the difference.
        options: Options of the device's decoder or session. Wrong: an option that the device does not have, or cannot
            have, refuses the config.
    """

    device: str
    package: str = ""
    port: str = Field(min_length=1, pattern=r"^[^\x00-\x1f]+$")
    sensor: str = ""
    hardware_id: str = ""
    baud: int | None = Field(default=None, gt=0)
    rate_hz: Hertz
    stale_s: float | None = None
    delay_s: float = Field(default=0.0, ge=0.0, le=1.0)
    poll_s: float = Field(default=0.0, ge=0.0, le=1.0)
    options: dict[str, Option] = Field(default={})
