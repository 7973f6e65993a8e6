"""Run the whole engine under random faults for hours of simulated time, much faster than real time.

    make soak    (runs this after the soak)
    PYTHONPATH=tests/support:benchmarks python -m campaign [--hours H] [--seed S] [--episodes N]

Every message is checked: its verdict against the true contact and the state of each stream, its numbers and its times.
The counts are printed; no file is written. An episode that goes wrong is printed with its seed;
``--seed S --episodes 1`` repeats it to the byte.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import sys
import time
from collections.abc import Iterator

from campaign.episodes import Episode, play

EPISODE_S = 15.0
"""Mean simulated length of an episode; gives the number of episodes for ``--hours``."""

MOST_TOLD = 10


def main(argv: list[str] | None = None) -> int:
    """Play the episodes; return 1 if any went wrong, else 0."""
    parser = argparse.ArgumentParser(
        prog="python -m campaign", description="Run the engine under random faults in simulated time."
    )
    parser.add_argument("--hours", type=float, default=0.1, help="simulated hours (default 0.1)")
    parser.add_argument(
        "--seed", type=int, default=1, help="seed of the first episode; each further episode adds 1 (default 1)"
    )
    parser.add_argument("--episodes", type=int, help="run this many episodes instead of a time; 1 repeats a failure")
    options = parser.parse_args(argv)
    count = options.episodes or max(1, round(options.hours * 3600 / EPISODE_S))
    begun_s, simulated_s, messages, failed = time.perf_counter(), 0.0, 0, 0
    for episode in _episodes(range(options.seed, options.seed + count)):
        simulated_s += episode.seconds
        messages += episode.messages
        if episode.faults:
            failed += 1
            if failed <= MOST_TOLD:
                _tell(episode)
    took_s = time.perf_counter() - begun_s
    print(
        f"{count} episodes, {simulated_s / 3600:.2f} hours in {took_s:.0f} s ({simulated_s / took_s:.1f} times real "
        f"time), {messages} messages; {failed} episodes that went wrong; "
        f"seeds {options.seed} to {options.seed + count - 1}"
    )
    return 1 if failed else 0


def _episodes(seeds: range) -> Iterator[Episode]:
    if len(seeds) == 1:
        yield play(seeds[0])
        return
    with multiprocessing.get_context("spawn").Pool(min(len(os.sched_getaffinity(0)), len(seeds))) as pool:
        yield from pool.imap_unordered(play, seeds)


def _tell(episode: Episode) -> None:
    print(f"seed {episode.seed}: to repeat: python -m campaign --seed {episode.seed} --episodes 1")
    for happened in episode.story[-3:]:
        print(f"  {happened}")
    for fault in episode.faults[:MOST_TOLD]:
        print(f"  WRONG {fault}", flush=True)


if __name__ == "__main__":
    sys.exit(main())
