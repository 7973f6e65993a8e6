"""Strength of each device's checksum: the table from which all bounds of the fuzzing come.

``position_bits`` is n where a random position of a random stream passes for a reading with a probability of at most
2⁻ⁿ; docs/devices.md says the same. ``mishap_bits`` is n where a reading that suffered one mishap of `fuzz.damage`
passes, with a content that was never sent, with a probability of at most 2⁻ⁿ; None where nothing but the transport
checks the content, as a datagram's or a WebSocket's own checksum does.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Strength:
    """Of one device.

    Attributes:
        position_bits: As above.
        position: What a random position must meet.
        mishap_bits: As above.
        mishap: What a damaged reading must meet, and what gets past it.
    """

    position_bits: int
    position: str
    mishap_bits: float | None
    mishap: str


_CRC = "CRC-16: all damage within 16 bits, and all but one in 2^16 of the rest"
_WEISS = "the Weiss sum: of two flipped bits up to one pair in 60, of more bytes one in 2^12"

STRENGTHS: dict[str, Strength] = {
    "bota": Strength(36, "header (8), CRC-16, twelve reserved bits", 16, _CRC),
    "netft": Strength(36, "the first record of a stream: number (16) and reserved bits (20)", None, "UDP"),
    "optoforce": Strength(
        46,
        "header (32) and 14 bits of a 16-bit sum",
        8.5,
        "a sum: two flipped bits of like weight cancel, and so does a byte that comes or goes where the sum is small",
    ),
    "robotous": Strength(49, "start, end, number, zero bits and an 8-bit sum", 8, "a sum of eight bits"),
    "gauges": Strength(41, "three fixed bytes, a reserved bit, CRC-16", 16, _CRC),
    "pvdf": Strength(40, "sync and version (24), CRC-16", 16, _CRC),
    "dsacon32": Strength(57, "preamble (24), id, length, content, and the Weiss sum (16)", 10, _WEISS),
    "wts": Strength(69, "preamble (24), id, length, content, and the Weiss sum (16)", 10, _WEISS),
    "tsf85": Strength(
        52, "start (8) and tags that fill the length exactly, in two packets", None, "no published check of the values"
    ),
    "papillarray": Strength(
        100, "markers (64), an index that fits to the last byte, a 16-bit sum", 8.5, "a sum, as of optoforce"
    ),
    "external": Strength(150, "a map with all the keys of a reading", None, "ZeroMQ over a local socket"),
    "xela": Strength(200, "a JSON object with a number and a sensor: some forty given characters", None, "WebSocket"),
    "robotiq_2f": Strength(39, "unit (8), one of two functions (7), length (8), CRC-16", 16, _CRC),
    "wsg": Strength(56, "preamble (24), id, length, status, and the Weiss sum (16)", 10, _WEISS),
    "external_gripper": Strength(80, "a map with all the keys of a report", None, "a local socket"),
}
