"""How much is fuzzed: a share in `make test`, many rounds in `make fuzz`."""

from __future__ import annotations

import os

ROUNDS = int(os.environ.get("FUZZ_ROUNDS", "1"))
"""Rounds of each test."""

SEED = int(os.environ.get("FUZZ_SEED", "20261122"))
"""Seed of the first round; each further one adds 1."""

SEEDS = range(SEED, SEED + ROUNDS)
