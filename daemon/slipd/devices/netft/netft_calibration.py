"""Calibration and output rate of a Net F/T or Ethernet Axia: reading both from the sensor, and setting the rate.

Source of the calibration: ATI Ethernet Axia manual (READCALINFO over TCP, the page ``netftapi2.xml`` over HTTP). The
output rate is read on that page, set by a CGI, and judged by the page again: ATI manual 9620-05-NET FT, section 8 (a
GET of ``/PAGE.cgi?variable=value`` sets a variable); gbartyzel/ros2_net_ft_driver, ``ati_ft_interface.cpp``:
``comm.cgi`` and ``comrdtrate``, up to 7000 Hz. Public clients quote section 4.7 of the manual: the rate is the sensor's
clock divided by a whole number, and another one is rounded up. None of them reads what the CGI answers.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial

from slipd.devices import Inquiry

MAX_ANSWER = 1 << 16
"""Longest answer, bytes; the XML page has about 5,000."""

COUNTS = (1.0, 1e12)
"""Smallest and largest plausible counts per unit; sensors in use have a million per newton or pound."""

INTERNAL_HZ = 7000.0
"""Rate of the sensor's clock where nothing else is reported, Hz."""

CLOCKS_HZ = (1.0, 1e6)
"""Lowest and highest plausible rate of the sensor's clock, Hz; the sensors in use have 7000."""

_LBF = 4.448_221_615_260_5
_KGF = 9.806_65
_INCH = 0.0254
FORCE_UNITS = {"lbf": _LBF, "N": 1.0, "klbf": 1e3 * _LBF, "kN": 1e3, "kgf": _KGF, "gf": 1e-3 * _KGF}
"""Newtons per unit, in the order of codes 1 to 6 of READCALINFO."""
TORQUE_UNITS = {
    "lbf-in": _LBF * _INCH,
    "lbf-ft": _LBF * 12 * _INCH,
    "N-m": 1.0,
    "N-mm": 1e-3,
    "kgf-cm": 1e-2 * _KGF,
    "kN-m": 1e3,
}
"""Newton metres per unit, in the order of codes 1 to 6 of READCALINFO."""

TCP_REPLY = struct.Struct(">2sBBII12x")  # header, unit codes, counts per unit; six scales of the 16-bit reading
TCP_HEADER = b"\x12\x34"
_HTTP = b"HTTP/1."
_STATUS = re.compile(rb"HTTP/1\.\d (\d{3})\b")
_ROOT = re.compile(rb"<([A-Za-z]\w*)")
_TAG = re.compile(r"<(scfgfu|scfgtu|cfgcpf|cfgcpt|cfgcalsn|runrate|comrdtrate)>([^<]{0,64})</\1>")
_SERIAL = re.compile(r"[\w.-]{1,32}", re.ASCII)


@dataclass(frozen=True, slots=True)
class Calibration:
    """Value of a count.

    Attributes:
        force_n: Newtons per count.
        torque_nm: Newton metres per count.
        identity: The reported serial number; "" if there is none.
        internal_hz: The reported rate of the sensor's clock, Hz; None if there is no plausible one.
        output_hz: The reported output rate, Hz; None if there is no plausible one.
    """

    force_n: float
    torque_nm: float
    identity: str = ""
    internal_hz: float | None = None
    output_hz: float | None = None


def from_counts(counts_per_force: float, counts_per_torque: float, force_unit: str, torque_unit: str) -> Calibration:
    """Return the calibration for the numbers and units that the sensor's configuration page shows.

    Raises:
        ValueError: A number is out of range, or a unit is unknown.
    """
    return Calibration(
        _per_count("force", FORCE_UNITS, force_unit, counts_per_force),
        _per_count("torque", TORQUE_UNITS, torque_unit, counts_per_torque),
    )


def read_tcp(answer: bytes) -> Calibration | str | None:
    """Read the answer to `TCP_INQUIRY`.

    Returns:
        The calibration; a text if the answer is wrong; or None if it is incomplete.
    """
    if not answer.startswith(TCP_HEADER[: len(answer)]) or len(answer) > TCP_REPLY.size:
        return "not an answer to READCALINFO"
    if len(answer) < TCP_REPLY.size:
        return None
    _, force_code, torque_code, counts_per_force, counts_per_torque = TCP_REPLY.unpack(answer)
    if not (1 <= force_code <= len(FORCE_UNITS) and 1 <= torque_code <= len(TORQUE_UNITS)):
        return f"unit codes must be from 1 to {len(FORCE_UNITS)}, got {force_code} and {torque_code}"
    force_unit, torque_unit = list(FORCE_UNITS)[force_code - 1], list(TORQUE_UNITS)[torque_code - 1]
    try:
        return from_counts(counts_per_force, counts_per_torque, force_unit, torque_unit)
    except ValueError as error:
        return str(error)


def read_xml(answer: bytes) -> Calibration | str | None:
    """Read the answer to `XML_INQUIRY`, with the same results as `read_tcp`.

    Only a few tags are extracted. The page is not parsed as XML, so no entity in it can expand.
    """
    if not answer.startswith(_HTTP[: len(answer)]) or len(answer) > MAX_ANSWER:
        return "not an HTTP answer"
    head, _, page = answer.partition(b"\r\n\r\n")
    if (status := _STATUS.match(head)) and status[1] != b"200":
        return f"the sensor's page answers with HTTP {status[1].decode()}"
    root = _ROOT.search(page)
    if root is None or b"</%s>" % root[1] not in page:
        return None
    tags = dict(_TAG.findall(page.decode("latin-1")))
    try:
        calibration = from_counts(float(tags["cfgcpf"]), float(tags["cfgcpt"]), tags["scfgfu"], tags["scfgtu"])
    except KeyError as error:
        return f"the sensor's page has no {error.args[0]}"
    except ValueError as error:
        return str(error)
    serial = tags.get("cfgcalsn", "")
    return replace(
        calibration,
        identity=f"S/N {serial}" if _SERIAL.fullmatch(serial) else "",
        internal_hz=_rate_hz(tags.get("runrate")),
        output_hz=_rate_hz(tags.get("comrdtrate")),
    )


def checked_hz(name: str, rate_hz: float) -> float:
    """Return a plausible rate of a sensor's clock, Hz, or 0 for no clock.

    Raises:
        ValueError: The rate is out of range.
    """
    slowest, fastest = CLOCKS_HZ
    if not (rate_hz == 0 or slowest <= rate_hz <= fastest):
        raise ValueError(f"{name} must be a rate from {slowest:g} to {fastest:g} Hz, or 0 for none, got {rate_hz:g}")
    return rate_hz


def _answer_fault(read: Callable[[bytes], Calibration | str | None], answer: bytes) -> str:
    """Return what is wrong with a complete answer; "" if nothing is."""
    found = read(answer)
    return "the answer ends too early" if found is None else found if isinstance(found, str) else ""


TCP_INQUIRY = Inquiry(port=49_151, request=b"\x01" + bytes(19), reply_bytes=24, check=partial(_answer_fault, read_tcp))
XML_INQUIRY = Inquiry(
    port=80, request=b"GET /netftapi2.xml HTTP/1.0\r\n\r\n", reply_bytes=0, check=partial(_answer_fault, read_xml)
)


def _rate_hz(text: str | None) -> float | None:
    """Return a plausible rate of the page, Hz; None if it is no number, or impossible."""
    try:
        rate_hz = float(text or 0)
    except ValueError:
        return None
    return rate_hz if CLOCKS_HZ[0] <= rate_hz <= CLOCKS_HZ[1] else None


def _per_count(name: str, units: Mapping[str, float], unit: str, counts: float) -> float:
    sizes = {_plain(known): size for known, size in units.items()}
    if _plain(unit) not in sizes:
        raise ValueError(f"{name}_unit must be one of {', '.join(units)}, got {unit!r}")
    least, most = COUNTS
    if not least <= counts <= most:
        raise ValueError(f"counts_per_{name} must be a number from {least:g} to {most:g}, got {counts:g}")
    return sizes[_plain(unit)] / counts


def _plain(unit: object) -> str:
    """Return a unit in a common spelling: sensors also write "Nm" for "N-m" and "g" for "gf"; a config may be wrong."""
    return str(unit).lower().replace("-", "").replace("f", "", 1)


FASTEST_HZ = 7912
"""Highest output rate in the manual of the Axia."""


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


def needed_change(output_hz: int, page: bytes) -> bytes:
    """Return the request that sets the rate; empty if the page reports that it is set, or reports no rate.

    The sensor stores the rate, so slipd never writes it without need.
    """
    calibration = read_xml(page)
    if not isinstance(calibration, Calibration) or calibration.output_hz is None:
        return b""
    if _is_set(output_hz, calibration.output_hz, calibration):
        return b""
    return f"GET /comm.cgi?comrdtrate={output_hz} HTTP/1.0\r\n\r\n".encode()


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
