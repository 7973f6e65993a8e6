"""What one comparison with an independent implementation found."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from importlib.metadata import metadata


@dataclass
class Comparison:
    """Agreements and differences between slipd and a peer.

    Attributes:
        device: Name in the list of devices.
        package: Distribution of the peer.
        direction: Which side reads the other.
        agrees: What was compared and found equal.
        differs: What was compared and found different, with both values.
        open: What the peer offers no way to compare.
    """

    device: str
    package: str
    direction: str
    agrees: list[str] = field(default_factory=list)
    differs: list[str] = field(default_factory=list)
    open: list[str] = field(default_factory=list)

    @property
    def peer(self) -> str:
        """Distribution, version and licence of the peer."""
        about = metadata(self.package)
        classified = [name.rpartition(" :: ")[2] for name in about.get_all("Classifier", []) if "License ::" in name]
        named = (about.get("License-Expression"), about.get("License"), *classified, "no licence stated")
        licence = next(text for text in named if text).splitlines()[0].rstrip()
        return f"{self.package} {about['Version']} ({licence})"

    def check(self, what: str, found: object, wanted: object) -> None:
        """Compare two values exactly."""
        (self.agrees if found == wanted else self.differs).append(
            what if found == wanted else f"{what}: {found}, slipd's side has {wanted}"
        )

    def check_near(self, what: str, found: Sequence[float], wanted: Sequence[float], tolerance: float) -> None:
        """Compare numbers that carry noise or quantisation."""
        near = len(found) == len(wanted) and all(
            math.isclose(value, right, rel_tol=0.0, abs_tol=tolerance)
            for value, right in zip(found, wanted, strict=True)
        )
        text = f"{what} within {tolerance:g}"
        (self.agrees if near else self.differs).append(
            text if near else f"{text}: {[round(value, 5) for value in found]}, slipd's side has {list(wanted)}"
        )
