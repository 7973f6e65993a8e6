"""Whether the tests notice a mistake: random mutants of the program, each against the tests of its room.

    PYTHONPATH=tests/support:tests/lab python -m mutate [--mutants N] [--seed N] [--room ROOM …] [--report FILE]
    PYTHONPATH=tests/support:tests/lab python -m mutate --wire [DEVICE …] [--report FILE]

A mutant changes one operator, constant or condition, or deletes one statement. The test file of the mutated file runs
first, then the other tests of its room. A mutant that no test notices is either a hole of the tests or changes nothing
that can be seen; the report lists them all. The draw depends on the seed and the sources alone.

``--wire`` tries every mutant of a scale, sign, byte order, offset or length of the decoders (`mutate.wire`) against the
tests of its device, and then of all devices.
"""

from __future__ import annotations

import argparse
import random
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from queue import SimpleQueue

from bench.commit import measured_on
from mutate.mutations import Mutation, mutate, mutations
from mutate.trial import Copy, Outcome
from mutate.wire import SHARED, is_noticed, wire_changes, wire_mutations

PROJECT = Path(__file__).parents[3]
TRUNK = (
    "devices", "signals", "fusion", "motion", "friction", "finger", "grasp", "links", "gripper", "requests", "publish",
    "engine", "config", "io/transport", "io/bus", "io/zmtp",
)  # fmt: skip
ROOMS = {Path(name).name: (f"daemon/slipd/{name}", f"tests/unit/{name}") for name in TRUNK} | {
    "client": ("clients/slipd_client", "tests/unit/client")
}
"""Room → folder of its sources and of its tests."""

EVERY_DECODER = "test_every_decoder.py"

LIMIT_S = 300.0
"""Longest run of the tests of one room, s; an endless loop is noticed."""


def main(argv: Sequence[str] | None = None) -> int:
    """Draw and try mutants, and print each; the exit code is 0."""
    parser = argparse.ArgumentParser(prog="python -m mutate", description="Try random mutants against the tests.")
    parser.add_argument("--mutants", type=int, default=300, metavar="N", help="default: %(default)s")
    parser.add_argument("--seed", type=int, default=1, metavar="N", help="of the draw (default: %(default)s)")
    parser.add_argument("--room", action="append", choices=ROOMS, help="only this room; may be repeated")
    parser.add_argument("--workers", type=int, default=2, metavar="N", help="mutants tried at a time (default: 2)")
    parser.add_argument("--report", type=Path, metavar="FILE", help="also write the report as Markdown")
    parser.add_argument("--wire", nargs="*", metavar="DEVICE", help="every number of these decoders (default: all)")
    options = parser.parse_args(argv)
    outcomes = []
    for outcome in _random(options) if options.wire is None else _wire(options.wire):
        outcomes.append(outcome)
        print(f"{outcome.verdict:9} {outcome.path}:{outcome.mutation.line}  {outcome.mutation.text}", flush=True)
    counts = Counter(outcome.verdict for outcome in outcomes)
    noticed = len(outcomes) - counts["survived"]
    print(f"{noticed} of {len(outcomes)} mutants noticed ({noticed / max(len(outcomes), 1):.1%})")
    if options.report:
        options.report.parent.mkdir(exist_ok=True)
        options.report.write_text(
            "\n".join(_page(outcomes, noticed, options.seed if options.wire is None else None)) + "\n", encoding="utf-8"
        )
    return 0


def _random(options: argparse.Namespace) -> Iterator[Outcome]:
    """Try random mutants, each in a copy of the project."""
    drawn = draw(options.room or list(ROOMS), options.mutants, options.seed)
    with tempfile.TemporaryDirectory(prefix="slipd-mutants-") as name, ThreadPoolExecutor(options.workers) as pool:
        free: SimpleQueue[Copy] = SimpleQueue()
        for number in range(options.workers):
            free.put(Copy(PROJECT, Path(name) / str(number)))

        def attempt(place: tuple[str, str, Mutation]) -> Outcome:
            room, path, mutation = place
            copy = free.get()
            try:
                return copy.try_mutant(path, mutation, _tests(room, path), LIMIT_S)
            finally:
                free.put(copy)

        yield from pool.map(attempt, drawn)


def _wire(devices: Sequence[str]) -> Iterator[Outcome]:
    """Try every mutant of a number on the wire."""
    sound: set[tuple[str, ...]] = set()
    for devices_of_it, name, mutation in wire_draw(devices):
        path = PROJECT / name
        source = path.read_text(encoding="utf-8")
        mutant = mutate(source, mutation, wire_changes)
        tests = PROJECT / ROOMS["devices"][1]
        groups = [[str(tests / "shared")]] if "shared" in name else []
        for device in devices_of_it.split():
            folder = tests / device
            groups.append([str(folder)] if folder.is_dir() else [*map(str, tests.glob(f"test_{device}*.py"))])
            groups.append([f"{tests}/{EVERY_DECODER}", "-k", device])
        for group in filter(None, groups):
            if tuple(group) not in sound and is_noticed(PROJECT / "daemon", path, source, group, int(LIMIT_S)):
                raise SystemExit(f"mutate: {' '.join(group)} must pass without a mutant")
            sound.add(tuple(group))
        noticed = any(is_noticed(PROJECT / "daemon", path, mutant, group, int(LIMIT_S)) for group in groups if group)
        yield Outcome(name, mutation, "killed" if noticed else "survived")


def draw(rooms: Sequence[str], count: int, seed: int) -> list[tuple[str, str, Mutation]]:
    """Return (room, path, mutation) of random mutants, without a repetition."""
    places = [
        (room, path.relative_to(PROJECT).as_posix(), mutation)
        for room in rooms
        for path in sorted((PROJECT / ROOMS[room][0]).rglob("*.py"))
        for mutation in mutations(path.read_text(encoding="utf-8"))
    ]
    return random.Random(seed).sample(places, min(count, len(places)))


def wire_draw(devices: Sequence[str]) -> Iterator[tuple[str, str, Mutation]]:
    """Yield (devices, path, mutation) of every number on the wire of these devices, of all where none is named."""
    room = PROJECT / ROOMS["devices"][0]
    shared = [room / "shared" / name for name in SHARED]
    users: dict[tuple[Path, Mutation], list[str]] = {}
    for place in sorted(room.iterdir()):
        name = place.stem
        if name not in ("shared", "__init__", "__pycache__") and (not devices or name in devices):
            for key in wire_mutations(([place] if place.is_file() else [*place.glob("*.py")]) + shared):
                users.setdefault(key, []).append(name)
    for (path, mutation), names in users.items():
        yield " ".join(names), path.relative_to(PROJECT).as_posix(), mutation


def _tests(room: str, path: str) -> list[list[str]]:
    """Return the tests of a file and then those of its room, relative to the project."""
    sources, tests = ROOMS[room]
    nearest = [
        found.relative_to(PROJECT).as_posix() for found in (PROJECT / tests).rglob(f"test_{Path(path).stem}*.py")
    ]
    inner = Path(path).relative_to(sources).parent
    folder = PROJECT / tests / inner
    near = [[folder.relative_to(PROJECT).as_posix()]] if inner.parts and folder.is_dir() else []
    return [group for group in ([nearest] if nearest else []) + near + [[tests]] if group]


def _page(outcomes: Sequence[Outcome], noticed: int, seed: int | None) -> Iterator[str]:
    yield "# Mutants"
    yield ""
    how = f"--mutants {len(outcomes)} --seed {seed}" if seed is not None else "--wire"
    yield f"`python -m mutate {how}`. {measured_on()}."
    yield ""
    yield f"The tests notice {noticed} of {len(outcomes)} mutants ({noticed / max(len(outcomes), 1):.1%})."
    yield ""
    place = _room if seed is not None else _device
    yield f"| {'room' if seed is not None else 'device'} | mutants | noticed |"
    yield "| --- | ---: | ---: |"
    rooms = Counter(place(outcome) for outcome in outcomes)
    survived = Counter(place(outcome) for outcome in outcomes if outcome.verdict == "survived")
    for room, number in sorted(rooms.items()):
        yield f"| {room} | {number} | {number - survived[room]} |"
    yield ""
    yield "| survivor | change |"
    yield "| --- | --- |"
    for outcome in outcomes:
        if outcome.verdict == "survived":
            change = outcome.mutation.text.replace("|", "\\|")
            yield f"| `{outcome.path}:{outcome.mutation.line}` | `{change}` |"


def _room(outcome: Outcome) -> str:
    return next(room for room, (sources, _) in ROOMS.items() if outcome.path.startswith(sources + "/"))


def _device(outcome: Outcome) -> str:
    parts = Path(outcome.path).relative_to(ROOMS["devices"][0]).parts
    return Path(parts[0]).stem if parts[0] != "shared" else "/".join(parts)


if __name__ == "__main__":
    sys.exit(main())
