import pytest
from simulation.bed import Bed, held_bed


@pytest.fixture
def held(seed: int) -> Bed:
    """A bed that holds the box; a test names its seeds."""
    return held_bed(seed)
