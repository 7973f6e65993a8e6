"""Run scenes through emulated sensors and the engine, score what it publishes, and keep the scores.

The bytes of the left finger's sensors enter the engine at reads 1 ms apart. Scores are kept in a cache by a hash of the
daemon's code, of this package and of the run, so that only what changed runs again.
"""

from __future__ import annotations

import hashlib
import os
import pickle
import zlib
from collections.abc import Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

from evaluate.finger_sensing import FingerSensing, offline_config
from evaluate.offline_grasp import BEGIN_NS, BOOT, Heard, run_offline
from evaluate.playing import SAFETY
from evaluate.reports import Reports, reports_of
from evaluate.scene import Scene
from evaluate.score import RunScore, score
from evaluate.user_errors import ERRORS
from evaluate.worlds import WORLDS
from project import DAEMON
from simulated_grasp.trace import GraspTrace

from slipd import config
from slipd.engine.engine import Engine
from slipd.events import Event, Publish

READ_NS = 1_000_000
FACTORS = (0.8, 0.9, 1.0, 1.1, 1.2)
FEW_MESSAGES = "[rates]\nwrench_hz = 1.0\ntactile_hz = 1.0\n"
"""Of topics that are not scored."""


@dataclass(frozen=True, slots=True)
class Variant:
    """How a run is configured, apart from its scene.

    Attributes:
        factor: μ of the config over the true static one; None: the config has none.
        error: Name of an error of the user, see `evaluate.user_errors`; "": none.
        finger_lines: More lines of ``[finger.left]``.
        extra: More tables of the config.
    """

    factor: float | None = 1.0
    error: str = ""
    finger_lines: str = ""
    extra: str = ""


@dataclass(frozen=True, slots=True)
class Task:
    """One grasp and the ways in which it is run, in one of the `evaluate.worlds`."""

    family: str
    seed: int
    variants: tuple[Variant, ...]
    world: str = "first"


@dataclass(frozen=True, slots=True, eq=False)
class Result:
    """The score of one run."""

    family: str
    seed: int
    variant: Variant
    score: RunScore
    world: str = "first"


class Tape:
    """The events of a run, for others on the same bytes: the config changes nothing before the engine.

    Attributes:
        events: Every event, and when it entered the engine, ns.
        text: Config of the run.
        heard: Its messages.
    """

    def __init__(self, text: str) -> None:
        self.events: list[tuple[int, Event]] = []
        self.text = text
        self.heard: list[Heard] = []

    def add(self, n: int, t_ns: int, topic: str, content: Event | bytes) -> None:
        """Keep an event; ignore a message."""
        if not isinstance(content, bytes):
            self.events.append((t_ns, content))

    def play(self, text: str) -> Iterator[tuple[int, str, dict[str, Any]]]:
        """Yield when each message of an engine with a config leaves it, ns, its topic and its body."""
        if text == self.text:
            yield from self.heard
            return
        engine = Engine(config.parse(text, "config of an offline run"), boot=BOOT, wall_minus_monotonic_ns=0)
        for t_ns, event in self.events:
            for output in engine.handle(event, t_ns):
                if isinstance(output, Publish):
                    yield t_ns - BEGIN_NS, output.topic, output.body


def record(scene: Scene, trace: GraspTrace, error: str, seed: int) -> Tape:
    """Return the events of a grasp with the sensors as they are, or with an error of the user."""
    tape = Tape(config_text(scene, Variant()))
    sensors = {"left": ERRORS[error](scene.sensors) if error else scene.sensors}
    tape.heard = run_offline(trace, sensors, tape.text, seed, read_ns=READ_NS, log=tape)
    return tape


def reports(scene: Scene, tape: Tape, variant: Variant) -> Reports:
    """Return what an engine with a config makes of the events of a grasp."""
    played = tape.play(config_text(scene, variant))
    bodies = ((t_ns + BEGIN_NS, body) for t_ns, topic, body in played if topic == "slip.left" and t_ns >= 0)
    return reports_of(bodies, BEGIN_NS)


def run(scene: Scene, trace: GraspTrace, variant: Variant, seed: int) -> Reports:
    """Run a simulated grasp through sensors and engine."""
    return reports(scene, record(scene, trace, variant.error, seed), variant)


def config_text(scene: Scene, variant: Variant) -> str:
    """Return the config of a run: the sensors as their user believes them to be."""
    mu = None if variant.factor is None else variant.factor * scene.friction.mu_s
    lines = f"grip_safety = {SAFETY}\ncontact_growth = {scene.patch.growth}\n{variant.finger_lines}"
    fingers: dict[str, FingerSensing] = {"left": scene.sensors}
    return offline_config(fingers, mu, finger_lines=lines, extra=FEW_MESSAGES + variant.extra)


def run_task(task: Task) -> list[Result]:
    """Simulate a grasp once and run and score it in every way."""
    world = WORLDS[task.world]
    scene = world.draw(task.family, task.seed)
    trace = world.play(scene)
    truth = world.truth_of(scene, trace)
    noise = zlib.crc32(f"{task.family} {task.seed}".encode())
    found = []
    record_once = cache(lambda error: record(scene, trace, error, noise))
    for variant in task.variants:
        published = reports(scene, record_once(variant.error), variant)
        figures = score(truth, published, steady=scene.steady, closed_s=scene.closed_s)
        found.append(Result(task.family, task.seed, variant, figures, task.world))
    return found


def run_all(tasks: Iterable[Task], workers: int = 1) -> Iterator[Result]:
    """Yield the result of every run, kept ones first."""
    left: list[Task] = []
    for task in tasks:
        missing = []
        for variant in task.variants:
            found = _kept(_path(task, variant))
            if found is None:
                missing.append(variant)
            else:
                yield Result(task.family, task.seed, variant, found, task.world)
        if missing:
            left.append(replace(task, variants=tuple(missing)))
    if workers <= 1 or len(left) <= 1:
        for task in left:
            yield from map(_keep, run_task(task))
        return
    with ProcessPoolExecutor(workers) as pool:
        for done in as_completed([pool.submit(run_task, task) for task in left]):
            yield from map(_keep, done.result())


def _keep(result: Result) -> Result:
    """Write a score to the cache; whole or not at all."""
    path = _path(Task(result.family, result.seed, (), result.world), result.variant)
    path.parent.mkdir(parents=True, exist_ok=True)
    draft = path.with_suffix(f".{os.getpid()}")
    draft.write_bytes(pickle.dumps(result.score))
    draft.replace(path)
    return result


def _kept(path: Path) -> RunScore | None:
    try:
        found: RunScore = pickle.loads(path.read_bytes())
    except (OSError, EOFError, pickle.UnpicklingError):
        return None
    return found


def _path(task: Task, variant: Variant) -> Path:
    name = hashlib.sha256(repr((task.world, task.family, task.seed, variant)).encode()).hexdigest()
    return cache_folder() / code_hash() / name[:32]


def cache_folder() -> Path:
    """Return the folder of kept scores."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "slipd" / "evaluate"


@cache
def code_hash() -> str:
    """Return a hash of everything that a score depends on besides the run."""
    found = hashlib.sha256()
    own = Path(__file__).parent
    scoring = ("draw", "families", "loads_that_hold", "loads_that_slip", "playing", "reports", "running", "scene",
               "score", "truth", "user_errors", "worlds")  # fmt: skip
    second = sorted((own.parent / "second_world").glob("rubber_*.py"))
    for path in (*sorted(DAEMON.rglob("*.py")), *(own / f"{name}.py" for name in scoring), *second):
        found.update(path.name.encode() + b"\0" + path.read_bytes())
    return found.hexdigest()[:24]
