"""What follows from the keys of a stream: its transport, when it is stale, what its taxels measure, device options."""

from __future__ import annotations

from typing import Any

from slipd.config.finger_model import Pad
from slipd.config.gripper_model import Gripper
from slipd.config.stream_model import Stream
from slipd.devices import DEVICES

_TRANSPORTS = {"ws": "websocket", "tcp": "tcp", "udp": "udp", "ipc": "external", "unix": "local"}

STALE_PERIODS = 3.0
"""Periods without a reading after which a stream is stale by default, but not before ``STALE_LEAST_NS``."""

STALE_LEAST_NS = 20_000_000


def transport_of(port: str) -> str:
    """Return the transport of a port, by its address: "serial" where the address is a path."""
    scheme, separator, _ = port.partition("://")
    return _TRANSPORTS.get(scheme, "serial") if separator else "serial"


def key_path(stream_name: str) -> str:
    """Return the key path of the table of a stream, such as "finger.left.pad" for ``left.pad``."""
    return {"gripper": "gripper", "object": "grasp.object"}.get(stream_name, f"finger.{stream_name}")


def stale_after_ns(stream: Stream) -> int:
    """Return the silence, and the age of a reading, beyond which a stream is stale for the verdict, ns."""
    if stream.stale_s is not None:
        return round(stream.stale_s * 1e9)
    return max(round(STALE_PERIODS * 1e9 / stream.rate_hz), STALE_LEAST_NS)


def axes_of(pad: Pad) -> int:
    """Return how many components a taxel of the pad measures; if the device leaves it open, as many as have a scale."""
    return DEVICES[pad.device].axes or len(pad.axis_scale)


def in_newtons(pad: Pad) -> bool:
    """Return whether a pad reads newtons, and not a unit that the config chose."""
    return pad.gain_error is not None or (
        DEVICES[pad.device].measures_newtons and set(map(abs, pad.axis_scale)) == {1.0}
    )


def device_options(stream: Stream) -> dict[str, Any]:
    """Return the options for the device's decoder or session: those of the file, and what other keys imply."""
    device = DEVICES[stream.device]
    options: dict[str, Any] = dict(stream.options)
    if isinstance(stream, Pad) and device.needs_size:
        options |= {"rows": stream.rows, "cols": stream.cols}
    if device.needs_wiring:
        options["wiring"] = transport_of(stream.port)
    if isinstance(stream, Gripper) and device.needs_tables and stream.force_table and stream.width_table:
        options |= {"force_table": stream.force_table, "width_table": stream.width_table}
        options["speed_table"] = stream.speed_table
    return options
