from __future__ import annotations

from typing import Any

import pytest
from replays import messages

from slipd.tools.plot.run_tracks import COUNTERS, RunTracks

SLIP: dict[str, Any] = {
    "level": "stable",
    "reasons": [],
    "evidence": [],
    "force_unit": "N",
    "normal_n": 10.0,
    "tangential_n": [3.0, 4.0],
    "spin_nm": 0.01,
    "centroid_m": [0.001, 0.002],
    "pole_m": [0.003, 0.004],
    "mu": 0.5,
    "mu_source": "config",
    "mu_low": 0.4,
    "mu_high": 0.6,
    "required_friction": 0.3,
    "relative_utilisation": None,
    "utilisation": 0.6,
    "utilisation_lower": 0.58,
    "utilisation_upper": 0.62,
    "grip_needed_n": 8.0,
}
"""What the plot reads of a message ``slip``."""


class Run:
    """Fills the tracks of a run that begins at 1 s of the clock."""

    def __init__(self) -> None:
        self.tracks = RunTracks(1_000_000_000)

    def add(self, topic: str, t_s: float, **fields: Any) -> None:
        t_ns = 1_000_000_000 + round(t_s * 1e9)
        self.tracks.add(topic, {"t_ns": t_ns} | (SLIP if topic.startswith("slip.") else {}) | fields)

    def add_event(self, t_s: float) -> None:
        self.tracks.add_event(1_000_000_000 + round(t_s * 1e9))

    def add_change(
        self, t_s: float, finger: str, previous: str, level: str, *reasons: str, rising: bool = True
    ) -> None:
        """A change of level, and the verdict that follows it at once."""
        words = {"reasons": list(reasons), "evidence": [], "utilisation": 0.9}
        self.add("warning", t_s, finger=finger, previous=previous, level=level, rising=rising, **words)
        self.add(f"slip.{finger}", t_s, level=level, reasons=list(reasons))

    def add_stream(self, t_s: float, health: int, message: str = "", **counters: Any) -> None:
        """The health of a pad, and of a force sensor that is well."""
        well = dict.fromkeys(COUNTERS, 0) | {"health": 0, "message": ""}
        ill = well | {"health": health, "message": message} | counters
        self.add("status", t_s, streams={"left.pad": ill, "left.wrench": well})

    def add_image(self, t_s: float, finger: str, *loads: float) -> None:
        self.add(f"tactile.{finger}", t_s, rows=2, cols=2, pitch_m=0.01, force_unit="N", loads_n=list(loads))


@pytest.fixture
def run() -> Run:
    return Run()


@pytest.fixture(scope="session")
def demo() -> tuple[RunTracks, list[tuple[str, dict[str, Any]]]]:
    """The recorded demo: its tracks and its messages."""
    found = messages("demo")
    tracks = RunTracks(found[0][1]["t_ns"])
    for topic, body in found:
        tracks.add(topic, body)
    return tracks, found
