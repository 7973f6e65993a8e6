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
        device: Name of the device, as listed in docs/devices.md.
        port: Path of a serial port, ``tcp://HOST:PORT``, ``udp://HOST:PORT``, ``ws://HOST:PORT``, or the local socket
            (``ipc:///PATH``, ``unix:///PATH``) to which another program connects.
        sensor: Name of the sensor on a port that carries several; "" where the port carries one.
        hardware_id: Serial number or name that the device reports (`slipctl status` shows it). A device that reports
            another one is refused. "": the first device that answers in a run is accepted.
        baud: Line speed of a serial port, bit/s; None: the default of the device.
        rate_hz: Expected readings per second.
        stale_s: A stream without a reading for this long is stale, s; so is a reading older than this on arrival. Time
            in which the daemon itself did not run does not count. None: three periods, at least 20 ms. Grip raises
            have a limit of their own. For a gripper this affects only the reported health.
        delay_s: Known delay from the acquisition of a reading to its earliest receipt, s, such as a filter delay.
        poll_s: Polling period of the line, s, where readings wait for the host to poll and carry no time: 0.001 for
            most USB adapters at 1 kHz. Half of it is subtracted from the time of receipt, and all of it is added to
            the uncertainty of that time.
        options: Options of the device's decoder or session.
    """

    device: str
    port: str = Field(min_length=1, pattern=r"^[^\x00-\x1f]+$")
    sensor: str = ""
    hardware_id: str = ""
    baud: int | None = Field(default=None, gt=0)
    rate_hz: Hertz
    stale_s: float | None = None
    delay_s: float = Field(default=0.0, ge=0.0, le=1.0)
    poll_s: float = Field(default=0.0, ge=0.0, le=1.0)
    options: dict[str, Option] = Field(default={})
