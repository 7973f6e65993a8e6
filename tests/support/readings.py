"""Streams of a device, and what is known of the readings in them."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest
from project import DOCS

from slipd.devices.shared.device_interface import DecoderHealth

T_NS = 77
"""When all data are received."""


def fields(name: str, values: Iterable[Any]) -> list[dict[str, Any]]:
    """Return one known field for each reading."""
    return [{name: value} for value in values]


def documented(name: str) -> bytes:
    """Return the bytes of a frame in docs/devices.md."""
    page = (DOCS / "devices.md").read_text(encoding="utf-8")
    (block,) = re.findall(rf"<!-- {name} frame -->\n+```\n(.*?)```", page, re.DOTALL)
    return bytes.fromhex("".join(line.split("|")[0] for line in block.splitlines()))


def dropped(*stretches: bytes, length: int) -> dict[str, Any]:
    """Return the counts of stretches of damage, where frames have this length."""
    sizes = [len(stretch) for stretch in stretches]
    return {"bad_bytes": sum(sizes), "bad": sum(max(1, (size + length // 2) // length) for size in sizes)}


@dataclass(frozen=True)
class Case:
    """A stream, and what a decoder makes of it, whole and byte by byte.

    Attributes:
        stream: The bytes.
        wanted: What is known of each reading: values of its fields.
        counts: Counts of the decoder's health that are not 0, beside ``good``.
        options: Of the decoder.
    """

    stream: bytes
    wanted: list[dict[str, Any]]
    counts: Mapping[str, Any] = field(default_factory=dict)
    options: Mapping[str, Any] = field(default_factory=dict)

    def check(self, make: Callable[..., Any]) -> None:
        for size in (len(self.stream), 1):
            decoder = make(**self.options)
            samples: list[Any] = []
            for at in range(0, len(self.stream), size):
                samples += decoder.receive(self.stream[at : at + size], T_NS)
            assert len(samples) == len(self.wanted)
            for number, (sample, known) in enumerate(zip(samples, self.wanted, strict=True)):
                assert sample.t_ns == T_NS
                for name, value in known.items():
                    _compare(getattr(sample, name), value, f"{name} of reading {number}")
            assert decoder.health == DecoderHealth(good=len(samples), **self.counts), decoder.health


def _compare(found: Any, value: Any, what: str) -> None:
    if isinstance(found, np.ndarray):
        assert found.dtype == np.float64, what
        assert found == pytest.approx(np.array(value), rel=1e-9, abs=1e-6), what
    else:
        assert found == (pytest.approx(value) if isinstance(value, float) else value), what
