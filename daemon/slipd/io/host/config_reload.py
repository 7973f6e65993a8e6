"""Read the config again when asked to; a faulty file changes nothing."""

from __future__ import annotations

import asyncio
import contextlib
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
            try:
                async with asyncio.timeout(READ_LIMIT_S):
                    read = await self._read()
            except TimeoutError:
                why = f"{self._file}: cannot be read within {READ_LIMIT_S:g} s: is it a pipe, or on a disk that hangs?"
                self._keep(kept_text(RuntimeError(why)), report)
                continue
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

    async def _read(self) -> Config:
        """Read the file on a thread that nothing waits for: neither a later request nor the end of the daemon."""
        loop = asyncio.get_running_loop()
        found: asyncio.Future[Config] = loop.create_future()

        def settle(config: Config | None, error: BaseException | None) -> None:
            if found.done():
                return
            if error is not None:
                found.set_exception(error)
            elif config is not None:
                found.set_result(config)

        def read() -> None:
            config, error = None, None
            try:
                config = load(self._file)
            except Exception as fault:
                error = fault
            with contextlib.suppress(RuntimeError):  # the loop has ended
                loop.call_soon_threadsafe(settle, config, error)

        threading.Thread(target=read, name="config", daemon=True).start()
        return await found

    def _keep(self, text: str, report: Callable[[Event], None]) -> None:
        _log.error("%s", text, extra={"slipd_fault": "config-kept"})
        report(HostNotice("config", text))


def kept_text(error: Exception) -> str:
    """Return that the config is kept because of an error, with the first line of the error."""
    first, *more = str(error).splitlines()
    others = f" (and {len(more)} more; slipd check lists them)" if more else ""
    return f"the config read before is kept: {first}{others}"
