"""Whether the tests notice a mistake: random mutants of the program, each against the tests of its room.

    PYTHONPATH=tests/support:benchmarks python -m mutate [--mutants N] [--seed N] [--room ROOM …] [--report FILE]
    PYTHONPATH=tests/support:benchmarks python -m mutate --file daemon/slipd/gripper/lease.py [--mutants N]
    PYTHONPATH=tests/support:benchmarks python -m mutate --wire [DEVICE …] [--report FILE]

A mutant changes one operator, constant or condition, or deletes one statement. The tests of its room that run the
changed line are tried on it, those of the test file of the same name first, then the tests of the engine that run it. A
mutant that no test notices is either a hole of the tests or changes nothing that can be seen: `equivalent.txt` lists
those with the reason, the report all others. Processes that a test starts run the mutant too. Tests with the mark
``process`` are left out, and so are slow ones (see `mutate.covered`), so that some survivors are noticed by `make
check`. The draw depends on the seed and the sources alone, and a change of a source replaces only mutants of its
changed lines. Unless rooms are named, it leaves out the tools.

``--wire`` tries every mutant of a scale, sign, byte order, offset or length of the decoders (`mutate.wire`) against the
tests of its device, and then of all devices.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from hashlib import sha256
from multiprocessing import get_context
from pathlib import Path

from bench.commit import measured_on
from mutate.covered import CoveredRoom, covered_room, is_compiled
from mutate.forked import noticed_as
from mutate.mutations import Mutation, mutate, mutations
from mutate.wire import SHARED, wire_changes, wire_mutations

PROJECT = Path(__file__).parents[2]
DAEMON = (
    *("signals", "fusion", "motion", "friction"),
    *("devices", "finger", "grasp", "links", "gripper", "requests", "publish", "engine", "config", "recording"),
    *("io", "io/transport", "io/zmtp"),
    *("tools", "tools/sim", "tools/evaluation", "tools/recordings", "tools/plot", "tools/export"),
    *("tools/discovery", "tools/commission"),
)
ROOMS = {Path(name).name: (f"daemon/slipd/{name}", f"tests/unit/{name}") for name in DAEMON} | {
    "client": ("clients/slipd_client", "tests/unit/client")
}
"""Room → folder of its sources and of its tests; a folder inside another room is no part of it."""

TOOLS = "daemon/slipd/tools"

CHAIN = "engine"
"""Room whose tests run the whole chain, from bytes to messages."""

EVERY_DEVICE = "test_every_*.py"
"""Tests that one table runs over all devices."""

LIMIT_S = 300
"""Processor time after which a mutant is noticed: an endless loop, s."""


@dataclass(frozen=True)
class Outcome:
    """What became of a mutant.

    Attributes:
        path: Mutated file, relative to the project.
        mutation: What was changed.
        verdict: "killed", "too slow", "survived" or "equal".
    """

    path: str
    mutation: Mutation
    verdict: str


def main(argv: Sequence[str] | None = None) -> int:
    """Draw and try mutants, and print each; the exit code is 0."""
    parser = argparse.ArgumentParser(prog="python -m mutate", description="Try random mutants against the tests.")
    parser.add_argument("--mutants", type=int, default=300, metavar="N", help="default: %(default)s")
    parser.add_argument("--seed", type=int, default=1, metavar="N", help="of the draw (default: %(default)s)")
    parser.add_argument("--room", action="append", choices=ROOMS, help="only this room; may be repeated")
    parser.add_argument("--file", action="append", metavar="FILE", help="only this source; may be repeated")
    parser.add_argument("--workers", type=int, default=2, metavar="N", help="mutants tried at a time (default: 2)")
    parser.add_argument("--report", type=Path, metavar="FILE", help="also write the report as Markdown")
    parser.add_argument("--wire", nargs="*", metavar="DEVICE", help="every number of these decoders (default: all)")
    options = parser.parse_args(argv)
    outcomes = []
    known = equivalents()
    for outcome in _random(options) if options.wire is None else _wire(options.wire):
        if (outcome.path, _line(outcome), outcome.mutation.text) in known:
            outcome = replace(outcome, verdict="equal")
        outcomes.append(outcome)
        print(f"{outcome.verdict:9} {outcome.path}:{outcome.mutation.line}  {outcome.mutation.text}", flush=True)
    counts = Counter(outcome.verdict for outcome in outcomes)
    outcomes = [outcome for outcome in outcomes if outcome.verdict != "equal"]
    noticed = len(outcomes) - counts["survived"]
    print(
        f"{noticed} of {len(outcomes)} mutants noticed ({noticed / max(len(outcomes), 1):.1%}), {counts['equal']} equal"
    )
    if options.report:
        options.report.parent.mkdir(exist_ok=True)
        options.report.write_text(
            "\n".join(_page(outcomes, noticed, options.seed if options.wire is None else None)) + "\n", encoding="utf-8"
        )
    return 0


def equivalents() -> set[tuple[str, str, str]]:
    """Return file, source line and change of each mutant that changes nothing that can be seen."""
    lines = Path(__file__).with_name("equivalent.txt").read_text(encoding="utf-8").splitlines()
    rows = [line.split(" | ") for line in lines if not line.startswith("#")]
    return {(path, " | ".join(source), change) for path, *source, change, _ in rows}


def _line(outcome: Outcome) -> str:
    return (PROJECT / outcome.path).read_text(encoding="utf-8").splitlines()[outcome.mutation.line - 1].strip()


def _random(options: argparse.Namespace) -> Iterator[Outcome]:
    """Try random mutants, each in a fork."""
    rooms = options.room or [room for room, (sources, _) in ROOMS.items() if not sources.startswith(TOOLS)]
    sources = {path.relative_to(PROJECT).as_posix() for room in rooms for path in files_of(room)}
    if unknown := set(options.file or ()) - sources:
        raise SystemExit(f"mutate: --file must be a source of a room, such as {min(sources)}, got {min(unknown)}")
    drawn = draw(rooms, options.mutants, options.seed, options.file)
    with (
        tempfile.TemporaryDirectory(prefix="slipd-mutants-") as scratch,
        ProcessPoolExecutor(options.workers, get_context("fork")) as pool,
    ):
        names = sorted({room for room, _, _ in drawn} | {CHAIN})
        covered = dict(zip(names, pool.map(partial(_covered, Path(scratch)), names), strict=True))
        rooms_tests = [_tests(place, covered[place[0]]) for place in drawn]
        yield from pool.map(_try, drawn, rooms_tests, [_tests(place, covered[CHAIN]) for place in drawn])


def _covered(scratch: Path, room: str) -> CoveredRoom:
    sources, tests = ROOMS[room]
    return covered_room(PROJECT, PROJECT / ("daemon/slipd" if room == CHAIN else sources), [tests], scratch / room)


def _tests(place: tuple[str, str, Mutation], room: CoveredRoom) -> list[str]:
    _, name, mutation = place
    return room.tests(name, (PROJECT / name).read_text(encoding="utf-8"), mutation)


def _try(place: tuple[str, str, Mutation], *groups: list[str]) -> Outcome:
    _, name, mutation = place
    path = PROJECT / name
    source = path.read_text(encoding="utf-8")
    mutant = mutate(source, mutation)
    root, recompile = PROJECT / Path(name).parts[0], is_compiled(source, mutation)
    for tests in filter(None, groups):
        files = sorted({test.partition("::")[0] for test in tests})
        if verdict := noticed_as(root, path, mutant, files, LIMIT_S, only=tests, recompile=recompile):
            return Outcome(name, mutation, verdict)
    return Outcome(name, mutation, "survived")


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
            groups.append([*map(str, sorted(tests.glob(EVERY_DEVICE))), "-k", device])
        for group in filter(None, groups):
            if tuple(group) not in sound and noticed_as(PROJECT / "daemon", path, source, group, LIMIT_S):
                raise SystemExit(f"mutate: {' '.join(group)} must pass without a mutant")
            sound.add(tuple(group))
        noticed = any(noticed_as(PROJECT / "daemon", path, mutant, group, LIMIT_S) for group in groups if group)
        yield Outcome(name, mutation, "killed" if noticed else "survived")


def draw(
    rooms: Sequence[str], count: int, seed: int, files: Sequence[str] | None = None
) -> list[tuple[str, str, Mutation]]:
    """Return (room, path, mutation) of random mutants, of these files where any is named.

    Each mutant's place in the order follows from the seed, its file, its line's text and its change.
    """
    places = {}
    for room in rooms:
        for path in files_of(room):
            name, source = path.relative_to(PROJECT).as_posix(), path.read_text(encoding="utf-8")
            if not files or name in files:
                seen: Counter[str] = Counter()
                for mutation in mutations(source):
                    text = f"{seed} | {name} | {source.splitlines()[mutation.line - 1].strip()} | {mutation.text}"
                    rank = sha256((text + " again" * seen[text]).encode()).hexdigest()
                    seen[text] += 1
                    places[rank] = (room, name, mutation)
    return [places[rank] for rank in sorted(places)[:count]]


def files_of(room: str) -> list[Path]:
    """Return the sources of a room."""
    folder = PROJECT / ROOMS[room][0]
    inner = [PROJECT / sources for sources, _ in ROOMS.values() if f"{sources}/".startswith(f"{ROOMS[room][0]}/")]
    inner.remove(folder)
    return [path for path in sorted(folder.rglob("*.py")) if not any(path.is_relative_to(other) for other in inner)]


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
    return max(
        (room for room, (sources, _) in ROOMS.items() if outcome.path.startswith(sources + "/")),
        key=lambda room: len(ROOMS[room][0]),
    )


def _device(outcome: Outcome) -> str:
    parts = Path(outcome.path).relative_to(ROOMS["devices"][0]).parts
    return Path(parts[0]).stem if parts[0] != "shared" else "/".join(parts)


if __name__ == "__main__":
    sys.exit(main())
