"""Output rate of a Net F/T: read on the sensor's page, set by its CGI, and judged by the page again.

Source: ATI manual 9620-05-NET FT, section 8 (a GET of ``/PAGE.cgi?variable=value`` sets a variable).
gbartyzel/ros2_net_ft_driver, ``ati_ft_interface.cpp``: ``comm.cgi`` and ``comrdtrate``, up to 7000 Hz. Public clients
quote section 4.7 of the manual: the rate is the sensor's clock divided by a whole number, and another one is rounded
up. None of them reads what the CGI answers.
"""

from __future__ import annotations

from slipd.devices.netft.netft_calibration import Calibration, read_xml
from slipd.devices.netft.netft_decoder import INTERNAL_HZ

FASTEST_HZ = 7912
"""Highest output rate in the manual of the Axia."""

_SET = "GET /comm.cgi?comrdtrate={} HTTP/1.0\r\n\r\n"


def checked_output_hz(output_hz: int, calibration: str) -> int:
    """Return the rate to set, Hz; 0 for none.

    Raises:
        ValueError: The rate is out of range, or not one that the page can confirm.
    """
    if output_hz not in range(FASTEST_HZ + 1):
        raise ValueError(
            f"output_hz must be an integer from 1 to {FASTEST_HZ}, or 0 for the sensor's own setting, got {output_hz}"
        )
    if output_hz and calibration != "xml":
        raise ValueError(
            f'output_hz = {output_hz} needs calibration = "xml": only the sensor\'s web page reports its output rate, '
            f'got calibration = "{calibration}"'
        )
    return int(output_hz)


def encode_change(output_hz: int) -> bytes:
    """Return the request that sets the output rate."""
    return _SET.format(output_hz).encode()


def needed_change(output_hz: int, page: bytes) -> bytes:
    """Return the request that sets the rate; empty if the page reports that it is set, or reports no rate.

    The sensor stores the rate, so slipd never writes it without need.
    """
    calibration = read_xml(page)
    if not isinstance(calibration, Calibration) or calibration.output_hz is None:
        return b""
    return b"" if _is_set(output_hz, calibration.output_hz, calibration) else encode_change(output_hz)


def rate_fault(output_hz: int, calibration: Calibration) -> str:
    """Return why the rate is not set according to the page that the sensor sent last, for people; "" if it is."""
    if not output_hz:
        return ""
    if calibration.output_hz is None:
        return f"its web page reports no output rate, so slipd did not set output_hz = {output_hz}"
    if _is_set(output_hz, calibration.output_hz, calibration):
        return ""
    return f"the sensor did not take output_hz = {output_hz}: its web page reports {calibration.output_hz:g} Hz"


def rounded_hz(output_hz: int, internal_hz: float) -> float:
    """Return the rate at which a sensor runs that is set to ``output_hz``, Hz: the next fraction of its clock."""
    return internal_hz / max(internal_hz // output_hz, 1)


def _is_set(output_hz: int, reported_hz: float, calibration: Calibration) -> bool:
    """Return whether the page reports the rate, or what the sensor makes of it."""
    rounded = rounded_hz(output_hz, calibration.internal_hz or INTERNAL_HZ)
    return min(abs(reported_hz - output_hz), abs(reported_hz - rounded)) < 1.0
