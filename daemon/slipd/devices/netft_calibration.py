"""What one count of an ATI Net F/T or Ethernet Axia is worth, and the two ways to ask the sensor for it.

Source: ATI Ethernet Axia manual (READCALINFO over TCP, the page ``netftapi2.xml`` over HTTP).
"""

from __future__ import annotations

import re
import struct
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

from slipd.devices import Inquiry

MAX_ANSWER = 1 << 16
"""Bytes. The XML page has some 5,000; what is longer is no answer."""

COUNTS = (1.0, 1e12)
"""Least and most counts a unit that a sensor can have: sensors in use have a million a newton or pound."""

INTERNAL_HZ = (1.0, 1e6)
"""Slowest and fastest clock that a sensor can have, Hz: the sensors in use have 7000."""

_LBF = 4.448_221_615_260_5
_KGF = 9.806_65
_INCH = 0.0254
FORCE_UNITS = {"lbf": _LBF, "N": 1.0, "klbf": 1e3 * _LBF, "kN": 1e3, "kgf": _KGF, "gf": 1e-3 * _KGF}
"""Newtons in each, in the order of the codes 1 to 6 of READCALINFO."""
TORQUE_UNITS = {
    "lbf-in": _LBF * _INCH,
    "lbf-ft": _LBF * 12 * _INCH,
    "N-m": 1.0,
    "N-mm": 1e-3,
    "kgf-cm": 1e-2 * _KGF,
    "kN-m": 1e3,
}
"""Newton metres in each, likewise."""

_TCP_REPLY = struct.Struct(">2sBBII12x")  # header, unit codes, counts per unit; six scales of the 16-bit reading
_TCP_HEADER = b"\x12\x34"
_HTTP = b"HTTP/1."
_STATUS = re.compile(rb"HTTP/1\.\d (\d{3})\b")
_ROOT = re.compile(rb"<([A-Za-z]\w*)")
_TAG = re.compile(r"<(scfgfu|scfgtu|cfgcpf|cfgcpt|cfgcalsn|runrate)>([^<]{0,64})</\1>")
_SERIAL = re.compile(r"[\w.-]{1,32}", re.ASCII)


@dataclass(frozen=True, slots=True)
class Calibration:
    """What counts are worth.

    Attributes:
        force_n: Newtons a count.
        torque_nm: Newton metres a count.
        identity: The sensor's serial number as it tells it; "" where it does not.
        internal_hz: Rate of the sensor's own clock as it tells it, Hz; None where it tells none that a sensor can have.
    """

    force_n: float
    torque_nm: float
    identity: str = ""
    internal_hz: float | None = None


def of_numbers(counts_per_force: float, counts_per_torque: float, force_unit: str, torque_unit: str) -> Calibration:
    """Return the calibration that the sensor's configuration page shows.

    Raises:
        ValueError: A number is not positive and finite, or a unit is not known.
    """
    return Calibration(
        _per_count("force", FORCE_UNITS, force_unit, counts_per_force),
        _per_count("torque", TORQUE_UNITS, torque_unit, counts_per_torque),
    )


def read_tcp(answer: bytes) -> Calibration | str | None:
    """Read the answer to `TCP_INQUIRY`.

    Returns:
        The calibration; what is wrong with the answer; or None while more of it must come.
    """
    if not answer.startswith(_TCP_HEADER[: len(answer)]) or len(answer) > _TCP_REPLY.size:
        return "not an answer to READCALINFO"
    if len(answer) < _TCP_REPLY.size:
        return None
    _, force_code, torque_code, counts_per_force, counts_per_torque = _TCP_REPLY.unpack(answer)
    if not (1 <= force_code <= len(FORCE_UNITS) and 1 <= torque_code <= len(TORQUE_UNITS)):
        return f"unit codes {force_code} and {torque_code} are not known"
    force_unit, torque_unit = list(FORCE_UNITS)[force_code - 1], list(TORQUE_UNITS)[torque_code - 1]
    try:
        return of_numbers(counts_per_force, counts_per_torque, force_unit, torque_unit)
    except ValueError as error:
        return str(error)


def read_xml(answer: bytes) -> Calibration | str | None:
    """Read the answer to `XML_INQUIRY`; returns as `read_tcp` does.

    A few tags are picked out; the page is not parsed, so nothing in it can expand.
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
        calibration = of_numbers(float(tags["cfgcpf"]), float(tags["cfgcpt"]), tags["scfgfu"], tags["scfgtu"])
        internal_hz = float(tags.get("runrate", 0))
    except KeyError as error:
        return f"the sensor's page has no {error.args[0]}"
    except ValueError as error:
        return str(error)
    serial = tags.get("cfgcalsn", "")
    return replace(
        calibration,
        identity=f"S/N {serial}" if _SERIAL.fullmatch(serial) else "",
        internal_hz=internal_hz if INTERNAL_HZ[0] <= internal_hz <= INTERNAL_HZ[1] else None,
    )


def checked_hz(name: str, rate_hz: float) -> float:
    """Return the rate of a sensor's clock, Hz, or 0 for none.

    Raises:
        ValueError: No sensor has such a rate.
    """
    slowest, fastest = INTERNAL_HZ
    if not (rate_hz == 0 or slowest <= rate_hz <= fastest):
        raise ValueError(f"{name} must be a rate from {slowest:g} to {fastest:g} Hz, or 0 for none, got {rate_hz:g}")
    return rate_hz


def _wrong(read: Callable[[bytes], Calibration | str | None]) -> Callable[[bytes], str]:
    """Make the check of a whole answer."""

    def check(answer: bytes) -> str:
        found = read(answer)
        return "the answer ends too early" if found is None else found if isinstance(found, str) else ""

    return check


TCP_INQUIRY = Inquiry(port=49_151, request=b"\x01" + bytes(19), reply_bytes=24, check=_wrong(read_tcp))
XML_INQUIRY = Inquiry(port=80, request=b"GET /netftapi2.xml HTTP/1.0\r\n\r\n", reply_bytes=0, check=_wrong(read_xml))


def encode_tcp(counts_per_force: int, counts_per_torque: int, force_code: int = 2, torque_code: int = 3) -> bytes:
    """Return the answer to READCALINFO; the codes are of N and N·m unless given."""
    return _TCP_REPLY.pack(_TCP_HEADER, force_code, torque_code, counts_per_force, counts_per_torque)


def encode_xml(tags: Mapping[str, str | int]) -> bytes:
    """Return the answer to the request of the page, with the given tags in it."""
    page = "".join(f"<{name}>{value}</{name}>\n" for name, value in tags.items())
    head = "HTTP/1.0 200 OK\r\nContent-Type: text/xml\r\n\r\n"
    return f'{head}<?xml version="1.0"?><netft>\n{page}</netft>\n'.encode()


def _per_count(name: str, units: Mapping[str, float], unit: str, counts: float) -> float:
    sizes = {_plain(known): size for known, size in units.items()}
    if _plain(unit) not in sizes:
        raise ValueError(f"{name}_unit {unit!r} is not known: {', '.join(units)} are")
    least, most = COUNTS
    if not least <= counts <= most:
        raise ValueError(f"counts_per_{name} must be a number from {least:g} to {most:g}, got {counts:g}")
    return sizes[_plain(unit)] / counts


def _plain(unit: str) -> str:
    """Return a unit without what sensors spell differently: "Nm" is "N-m", and "g" is "gf"."""
    return unit.lower().replace("-", "").replace("f", "", 1)
