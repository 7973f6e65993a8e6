"""What a process and an engine hold: memory, files, tasks, objects, and the length of every container."""

from __future__ import annotations

import asyncio
import gc
import os
import sys
import threading
from collections import Counter, deque
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from simulation.size import size_of

CONTAINERS = (dict, list, set, deque, bytearray)
PLAIN = (str, bytes, int, float, complex, bool, type(None), type, np.ndarray, np.generic)
DEEPEST = 12


@dataclass(frozen=True)
class ShiftHoldings:
    """What is held at a time.

    Attributes:
        hours: Simulated time since the start.
        memory_kb: Resident memory of its own (RssAnon).
        mapped_kb: Resident pages of files, such as libraries: the kernel drops and reads them as it likes.
        blocks: Blocks of memory that Python allocated.
        objects: Objects that the garbage collector knows.
        files: Open files but recordings.
        tasks: Tasks of the event loop.
        threads: Threads.
        engine_bytes: Size of the engine with all that it refers to.
        containers: Number of entries of every container in the engine, by its place.
    """

    hours: float
    memory_kb: int
    mapped_kb: int
    blocks: int
    objects: int
    files: int
    tasks: int
    threads: int
    engine_bytes: int
    containers: dict[str, int]

    @classmethod
    def now(cls, hours: float, engine: Any) -> ShiftHoldings:
        """Of this process, after a collection of garbage."""
        gc.collect()
        status = Path("/proc/self/status").read_text()
        memory_kb, mapped_kb = (int(status.partition(name)[2].split()[0]) for name in ("RssAnon:", "RssFile:"))
        return cls(
            hours,
            memory_kb,
            mapped_kb,
            sys.getallocatedblocks(),
            len(gc.get_objects()),
            sum(not name.endswith(".mcap") for name in open_names()),
            len(asyncio.all_tasks()),
            threading.active_count(),
            size_of(engine),
            dict(containers_in(engine)),
        )

    def as_dict(self) -> dict[str, Any]:
        """Return all figures, for a file: what was measured must not grow in this process."""
        return asdict(self)


def open_names() -> list[str]:
    """Return the names of all open files."""
    names = []
    for entry in os.scandir("/proc/self/fd"):
        with suppress(OSError):  # that of the scan itself
            names.append(str(Path(entry.path).readlink()))
    return names


def containers_in(root: Any) -> Counter[str]:
    """Return the number of entries of every container, by its place; alike places in a container count together."""
    counts: Counter[str] = Counter()
    seen: set[int] = set()
    waiting: deque[tuple[str, Any, int]] = deque([("engine", root, 0)])
    while waiting:
        place, thing, depth = waiting.popleft()
        if isinstance(thing, PLAIN) or id(thing) in seen or depth > DEEPEST:
            continue
        seen.add(id(thing))
        if isinstance(thing, CONTAINERS):
            counts[place] += len(thing)
        if isinstance(thing, (dict, list, set, deque, tuple, frozenset)):
            inner = thing.values() if isinstance(thing, dict) else thing
            waiting += [(f"{place}[]", one, depth + 1) for one in inner]
        elif type(thing).__module__.startswith("slipd"):
            waiting += [(f"{place}.{name}", value, depth + 1) for name, value in _attributes(thing)]
    return counts


def _attributes(thing: Any) -> list[tuple[str, Any]]:
    names = [name for kind in type(thing).__mro__ for name in getattr(kind, "__slots__", ())]
    slots = [(name, getattr(thing, name)) for name in names if hasattr(thing, name)]
    return [*slots, *getattr(thing, "__dict__", {}).items()]
