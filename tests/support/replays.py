"""Recordings of earlier runs, replayed, and all that the engine gave out for them then.

    PYTHONPATH=tests/support python -m replays                     report what differs
    PYTHONPATH=tests/support python -m replays --renew NAME ...    write what is given out now

Renew only where a rule was changed on purpose: read the differences first, and name the rule in the commit.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import zstandard
from known_zeros import know_zeros
from project import DATA

from slipd import config
from slipd.engine.engine import Engine
from slipd.events import LinkUp, Output, Publish, Record, Reply, Request, Write
from slipd.recording.reader import open_recording
from slipd.recording.replay import replay

RECORDINGS = DATA / "replays"
NAMES = tuple(sorted(path.stem for path in RECORDINGS.glob("*.mcap")))

UNTARED = ("papillarray", "tsf85")
"""Recordings of pads with an offset that no tare removes."""

RELATIVE = 1e-9
"""Largest relative difference of a number: processors sum in different orders."""

ABSOLUTE = {"n": 1e-10, "nm": 1e-12, "m": 1e-12, "m2": 1e-15, "rad": 1e-9, "timestamp": 1e-6}
"""Difference that is nothing, by the unit that ends a key: where forces cancel, no digit of the rest is certain."""

ABSOLUTE_ELSE = 1e-12
DIGITS = 12
"""Significant digits that are stored of a number."""


class Given(NamedTuple):
    """Something that the engine gave out.

    Attributes:
        event: Index of the event in the recording; one past the last for what ends the run.
        kind: "message", "reply", "write" or "record".
        name: Topic, client (hexadecimal), link, or name of the recording.
        body: The map; the bytes of a write, hexadecimal; the links that are open when a recording begins.
    """

    event: int
    kind: str
    name: str
    body: Any


def messages(name: str) -> list[tuple[str, dict[str, Any]]]:
    """Return topic and body of every message of a replay."""
    return list(replay(open_recording(RECORDINGS / f"{name}.mcap")))


def given(name: str) -> list[Given]:
    """Feed a recording to an engine; return all that it gives out, the farewell to the devices included."""
    recording = open_recording(RECORDINGS / f"{name}.mcap")
    settings = config.parse(recording.config_text, name)
    engine = Engine(settings, boot=recording.boot, wall_minus_monotonic_ns=recording.wall_minus_monotonic_ns)
    events = list(recording.events())
    tares = any(isinstance(event, Request) and event.body.get("op") == "tare" for _, event in events)
    if not tares and name not in UNTARED:  # most are older than the rule that an unknown zero shows nothing
        know_zeros(*engine._fingers.values())
    found = [_given(n, out) for n, (t_ns, event) in enumerate(events) for out in engine.handle(event, t_ns)]
    return found + [_given(len(events), write) for write in engine.farewell()]


def _given(event: int, output: Output) -> Given:
    match output:
        case Publish(topic, body):
            return Given(event, "message", topic, body)
        case Reply(client, body):
            return Given(event, "reply", client.hex(), body)
        case Write(link, data):
            return Given(event, "write", link, data.hex())
        case Record(name, opened):
            return Given(
                event, "record", name, [[link.link, link.identity] for link in opened if isinstance(link, LinkUp)]
            )


def stored(name: str) -> list[Given]:
    """Return what the engine gave out then."""
    lines = zstandard.ZstdDecompressor().decompress(_path(name).read_bytes()).splitlines()
    return [Given(*json.loads(line)) for line in lines]


def stored_messages(name: str) -> list[tuple[str, dict[str, Any]]]:
    """Return topic and body of every message that it gave out then."""
    return [(each.name, each.body) for each in stored(name) if each.kind == "message"]


def store(name: str, found: list[Given]) -> None:
    """Store what is given out now as what is right."""
    lines = [json.dumps(_rounded(list(one)), separators=(",", ":"), ensure_ascii=False) for one in found]
    _path(name).write_bytes(zstandard.ZstdCompressor(level=19).compress("\n".join(lines).encode()))


def _path(name: str) -> Path:
    return RECORDINGS / f"{name}.jsonl.zst"


def _rounded(value: Any, key: str = "") -> Any:
    if isinstance(value, dict):
        return {inner: _rounded(found, inner) for inner, found in value.items()}
    if isinstance(value, list):
        return [_rounded(found, key) for found in value]
    return float(f"{value:.{DIGITS}g}") if isinstance(value, float) and key != "timestamp" else value


def differences(then: Any, now: Any, at: str = "") -> Iterator[str]:
    """Yield what differs: any key, its order, length, type or value but the wording of texts, and more than rounding.

    Args:
        then: Of a stored output.
        now: The same, given out now.
        at: Keys on the way to both, with points between.
    """
    if type(then) is not type(now):
        yield f"{at}: was {then!r}, is {now!r}"
    elif isinstance(then, dict):
        if list(then) != list(now):
            yield f"{at}: had the keys {', '.join(then)}, has {', '.join(now)}"
        for key in then.keys() & now.keys():
            yield from differences(then[key], now[key], f"{at}.{key}" if at else key)
    elif isinstance(then, list):
        if len(then) != len(now):
            yield f"{at}: had {len(then)} items, has {len(now)}"
        for one, other in zip(then, now, strict=False):
            yield from differences(one, other, at)
    elif not (_close(then, now, at) if isinstance(then, float) else _same(then, now, at)):
        yield f"{at}: was {then!r}, is {now!r}"


def _close(then: float, now: float, at: str) -> bool:
    key = at.rpartition(".")[2]
    if key == "axis_rad":  # an axis has no sense: half a turn is none
        now = then + math.remainder(now - then, math.pi)
    relative = 0.0 if key == "timestamp" else RELATIVE
    return math.isclose(then, now, rel_tol=relative, abs_tol=ABSOLUTE.get(key.rpartition("_")[2], ABSOLUTE_ELSE))


def _same(then: Any, now: Any, at: str) -> bool:
    return bool(then) == bool(now) if _is_for_people(at) else bool(then == now)


def _is_for_people(at: str) -> bool:
    """Whether a text may be reworded; a version is no rule either."""
    return at.endswith(("error.message", "given_up", "version")) or (
        ".streams." in f".{at}" and at.endswith(".message")
    )


def main() -> int:
    """Report what differs, or renew; return 1 where anything differs."""
    parser = argparse.ArgumentParser(prog="python -m replays", description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help="only these recordings")
    parser.add_argument("--renew", action="store_true", help="store what is given out now; names them one by one")
    options = parser.parse_args()
    if options.renew and not options.names:
        parser.error("--renew needs the names of the recordings that the changed rule affects")
    different = 0
    for name in options.names or NAMES:
        found = given(name)
        then = stored(name) if _path(name).exists() else []
        told = list(differences([list(one) for one in then], [list(one) for one in found]))
        print(f"{name}: {len(then)} outputs then, {len(found)} now, {len(told)} differences", *told[:5], sep="\n    ")
        different += bool(told)
        if options.renew:
            store(name, found)
    return int(different and not options.renew)


if __name__ == "__main__":
    sys.exit(main())
