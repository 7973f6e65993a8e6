"""Explain why an open link gives no reading, and what to check at the device."""

from __future__ import annotations

from dataclasses import dataclass

from slipd.devices import Device
from slipd.events import LinkSpec


@dataclass(frozen=True, slots=True)
class LinkActivity:
    """What arrives over a link that gives no reading.

    Attributes:
        bytes_come: Bytes arrive.
        garbled: Some of them belong to no frame.
        others: Readings of other sensors on the same port arrive.
        state: State of the conversation with the device; "" where there is none.
    """

    bytes_come: bool
    garbled: bool
    others: bool
    state: str


def why_silent(device: Device, spec: LinkSpec, sensor: str, activity: LinkActivity) -> str:
    """Return why the stream may be silent, and what to check.

    Args:
        device: What is expected on the link.
        spec: The link.
        sensor: Which sensor of the port is silent; "" where it carries one.
        activity: What arrives instead.
    """
    if activity.others:
        return f"readings arrive, none of sensor {sensor!r}: is it plugged in? is `sensor` right?"
    if not activity.bytes_come:
        return _no_bytes(spec)
    if activity.garbled and spec.transport in ("external", "local"):
        return f"bytes arrive, none is {device.frame}: does the driver pack them as docs/devices.md says?"
    if activity.garbled:
        return f"bytes arrive, none is {device.frame}: {_line(device, spec)} is it another device?"
    doing = f" ({activity.state})" if activity.state else ""
    return f"bytes arrive, but no reading{doing}"


def _no_bytes(spec: LinkSpec) -> str:
    if spec.transport == "external":
        return f"open, but nobody pushes readings: does the driver run, and does it push to {spec.address}?"
    if spec.transport == "local":
        return "a driver is connected, but sends nothing: does it register the gripper?"
    where = "this port" if spec.transport == "serial" else spec.address
    return f"open, but no bytes arrive: is it powered? is it connected to {where}?"


def _line(device: Device, spec: LinkSpec) -> str:
    """Ask about the setting that makes a device unreadable, or selects another one."""
    if spec.transport != "serial":
        return f"is {spec.address} its address?"
    default = f" (the default is {device.baud})" if spec.baud != device.baud else ""
    return f"is the baud rate {spec.baud}{default}?"
