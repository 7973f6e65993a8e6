from collections.abc import Iterator

import pytest
from simulation.bed import Bed, held_bed


@pytest.fixture
def seed() -> int:
    return 1


@pytest.fixture
def held(seed: int) -> Iterator[Bed]:
    """A bed that holds the box; at the end, nothing that was watched is at fault."""
    bed = held_bed(seed)
    yield bed
    assert bed.watch.faults == [], f"seed {seed}"
