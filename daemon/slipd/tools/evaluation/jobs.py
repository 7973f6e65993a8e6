"""One replay to be done, and what it gave."""

from __future__ import annotations

import traceback
from functools import cache
from pathlib import Path
from typing import NamedTuple

from slipd.errors import SlipdError
from slipd.fusion.source_stamp import source_stamp
from slipd.tools.evaluation.config_run import ConfigRun


class NamedConfig(NamedTuple):
    """A config: its name for people, and its text, TOML; None: that of each recording."""

    name: str
    text: str | None


class Job(NamedTuple):
    """A recording to be replayed with a config; the key names the result in the cache."""

    path: Path
    config: NamedConfig
    key: str


class LastingFault(str):
    """Why a recording cannot be replayed with a config, by what is in both: another try would end in the same way."""

    __slots__ = ()


class Finished(NamedTuple):
    """What a job gave; a text is why there is no run. ``kept``: it was in the cache."""

    job: Job
    run: ConfigRun | str
    kept: bool = False


@cache
def own_stamp() -> str:
    """Return a hash of the source code of slipd."""
    return source_stamp(Path(__file__).parents[2])


def replay_job(job: Job) -> ConfigRun | str:
    """Replay a recording, in whatever process this is; whatever goes wrong with one recording is its result."""
    from slipd.tools.evaluation.config_replay import run_config  # here: where all results are kept, no engine is loaded

    try:
        return run_config(job.path, job.config.text, job.config.name)
    except SlipdError as error:
        return str(error) if _by_access(error) else LastingFault(str(error))
    except MemoryError:
        return f"{job.path}: not enough memory to replay it"
    except Exception as error:
        place = traceback.extract_tb(error.__traceback__)[-1]
        where = f"{Path(place.filename).name}:{place.lineno}"
        return f"{job.path}: an error of slipd, please report it: {type(error).__name__}: {error} ({where})"


def _by_access(error: BaseException | None) -> bool:
    """Return whether an error came of a file that could not be read, which may go well another time."""
    return error is not None and (isinstance(error, OSError) or _by_access(error.__cause__))
