"""Read the config again when asked to; a faulty file changes nothing."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable
from pathlib import Path

from slipd.config import Config, load
from slipd.errors import ConfigError
from slipd.events import Event, HostNotice

_log = logging.getLogger(__name__)


class ConfigReload:
    """Waits for requests to read a config file again.

    Args:
        file: The file.
        requested: Set by each request.

    Attributes:
        found: The changed config to start with, free of faults; None while nothing changed or the new one is faulty.
    """

    def __init__(self, file: Path, requested: asyncio.Event) -> None:
        self._file = file
        self._requested = requested
        self.found: Config | None = None

    async def watch(self, config: Config, report: Callable[[Event], None], stop: asyncio.Event) -> None:
        """Read the file at each request, until it holds another config without faults.

        Args:
            config: The config in use.
            report: Called with a notice of the faults, or of their end.
            stop: Set when another config is found.
        """
        while self.found is None:
            await self._requested.wait()
            self._requested.clear()
            try:
                read = await asyncio.to_thread(load, self._file)
            except ConfigError as error:
                self._keep(kept_text(error), report)
                continue
            except Exception as error:  # an error in a check must not end a run that holds something
                self._keep(kept_text(RuntimeError(f"{self._file}: {type(error).__name__}: {error}")), report)
                continue
            if read.text == config.text:
                _log.info("%s: not changed", self._file)
                report(HostNotice("config", ""))
                continue
            self.found = read
        stop.set()

    def _keep(self, text: str, report: Callable[[Event], None]) -> None:
        _log.error("%s", text, extra={"slipd_fault": "config-kept"})
        report(HostNotice("config", text))


def kept_text(error: Exception) -> str:
    """Return that the config is kept because of an error, with the first line of the error."""
    first, *more = str(error).splitlines()
    others = f" (and {len(more)} more; slipd check lists them)" if more else ""
    return f"the config read before is kept: {first}{others}"
