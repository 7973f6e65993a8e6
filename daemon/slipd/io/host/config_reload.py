"""Read the config again when asked to; a faulty file changes nothing."""

from __future__ import annotations

import asyncio
import concurrent.futures
import logging
import threading
from collections.abc import Callable
from pathlib import Path

from slipd.config import Config, load
from slipd.errors import ConfigError
from slipd.events import Event, HostNotice

READ_LIMIT_S = 5.0
"""Longest wait for the disk, s; the config before is then kept."""

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
            fault: Exception | None = None
            try:
                async with asyncio.timeout(READ_LIMIT_S):
                    read = await self._read()
            except TimeoutError:
                why = f"cannot be read within {READ_LIMIT_S:g} s: is it a pipe, or on a disk that hangs?"
                fault = RuntimeError(f"{self._file}: {why}")
            except ConfigError as error:
                fault = error
            except Exception as error:  # an error in a check must not end a run that holds something
                fault = RuntimeError(f"{self._file}: {type(error).__name__}: {error}")
            if fault is not None:
                _log.error("%s", kept_text(fault), extra={"slipd_fault": "config-kept"})
                report(HostNotice("config", kept_text(fault)))
            elif read.text == config.text:
                _log.info("%s: not changed", self._file)
                report(HostNotice("config", ""))
            else:
                self.found = read
        stop.set()

    async def _read(self) -> Config:
        """Read the file on a thread that nothing waits for: neither a later request nor the end of the daemon."""
        found: concurrent.futures.Future[Config] = concurrent.futures.Future()
        found.set_running_or_notify_cancel()  # from here on, giving up waiting does not cancel it

        def read() -> None:
            try:
                found.set_result(load(self._file))
            except Exception as error:
                found.set_exception(error)

        threading.Thread(target=read, name="config", daemon=True).start()
        return await asyncio.wrap_future(found)


def kept_text(error: Exception) -> str:
    """Return that the config is kept because of an error, with the first line of the error."""
    first, *more = str(error).splitlines()
    others = f" (and {len(more)} more; slipd check lists them)" if more else ""
    return f"the config read before is kept: {first}{others}"
