"""``python -m simulation``: the whole engine under random faults for hours of its own time, much faster than real time.

An episode that shows a fault is printed with its seed; ``--seed S --episodes 1`` plays it again, to the byte.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import sys
import time
from collections.abc import Iterator

from simulation.campaign import Episode, play

EPISODE_S = 15.0
"""About what an episode takes of its own time: how many there are to be is told by it."""

MOST_TOLD = 10


def main(argv: list[str] | None = None) -> int:
    """Plays episodes; 1 where one showed a fault."""
    parser = argparse.ArgumentParser(prog="python -m simulation", description=__doc__)
    parser.add_argument("--hours", type=float, default=0.1, help="to simulate (default 0.1)")
    parser.add_argument("--seed", type=int, default=1, help="of the first episode; the next ones count on (default 1)")
    parser.add_argument("--episodes", type=int, help="so many instead of hours: 1 repeats a failure")
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
        f"time), {messages} messages; {failed} episodes with faults; seeds {options.seed} to {options.seed + count - 1}"
    )
    return 1 if failed else 0


def _episodes(seeds: range) -> Iterator[Episode]:
    if len(seeds) == 1:
        yield play(seeds[0])
        return
    with multiprocessing.get_context("spawn").Pool(min(len(os.sched_getaffinity(0)), len(seeds))) as pool:
        yield from pool.imap_unordered(play, seeds)


def _tell(episode: Episode) -> None:
    print(f"seed {episode.seed}: again: python -m simulation --seed {episode.seed} --episodes 1")
    for happened in episode.story[-3:]:
        print(f"  {happened}")
    for fault in episode.faults[:MOST_TOLD]:
        print(f"  FAULT {fault}", flush=True)


if __name__ == "__main__":
    sys.exit(main())
