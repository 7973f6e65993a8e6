"""Arguments of ``slipd doctor``."""

from __future__ import annotations

import argparse
from pathlib import Path

from slipd.tools.cli_arguments import positive


def add_doctor_arguments(doctor: argparse.ArgumentParser) -> None:
    """Add the port, the device, and how it is read."""
    doctor.epilog = (
        "Nothing moves: a gripper is only asked for its status. Writes a report and a capture of the bytes, "
        "which name no port, host or user (docs/first_hardware.md). Exit code 1: something is wrong, or the port "
        "cannot be opened."
    )
    doctor.add_argument("port", metavar="PORT", help="serial port or address; or a FILE.capture, to examine it again")
    doctor.add_argument("--device", metavar="NAME", help="name of the device (slipd devices)")
    doctor.add_argument("--seconds", type=positive, default=10.0, metavar="S", help="how long to read (default 10)")
    doctor.add_argument("--rate", type=positive, metavar="HZ", help="expected readings per second (default: any)")
    doctor.add_argument("--baud", type=int, metavar="N", help="line speed, bit/s (default: the device's)")
    doctor.add_argument(
        "--options", default="", metavar="TOML", help="options of the device, such as 'rows = 8, cols = 16'"
    )
    doctor.add_argument(
        "--out", type=Path, default=Path(), metavar="DIR", help="folder for report and capture (default: this one)"
    )
