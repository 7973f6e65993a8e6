"""Faults of ``[bus]``: endpoints that cannot be served, and endpoints that would admit anybody."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from pathlib import Path

from slipd.config.bus_model import Bus
from slipd.config.model import Config
from slipd.config.value_bounds import Fault

_ENDPOINT = re.compile(r"ipc:///[^\0]+|tcp://(\d{1,3}(\.\d{1,3}){3}|localhost|\*):(\d{1,5}|\*)")
_LOCAL = re.compile(r"tcp://(127\.|localhost:)")


def bus_faults(config: Config) -> list[Fault]:
    """Find endpoints that cannot be served or would admit anybody; binding finds the rest."""
    bus = config.bus
    faults = _endpoint_faults("publish", bus.publish, "readers", bus)
    faults += _endpoint_faults("requests", bus.requests, "requesters", bus)
    lists = [name for name in ("readers", "requesters") if getattr(bus, name) is not None]
    if bus.secret_key is None:
        faults += [(f"bus.{name}", "needs bus.secret_key, the key of the daemon itself") for name in lists]
    elif not lists:
        rule = "needs bus.readers, bus.requesters or both: without a list no client has to show a key"
        faults.append(("bus.secret_key", rule))
    return faults


def missing_keys(bus: Bus) -> Iterator[tuple[str, str]]:
    """Yield the key path and the text of each file of keys that does not exist, with the command that creates it."""
    for name in ("secret_key", "readers", "requesters"):
        place = getattr(bus, name)
        if place is None or os.path.lexists(place) or not _is_visible(Path(place).parent):
            continue
        mend = f"mkdir -m 755 {place}, and copy the .key of each client there (slipctl keys new NAME)"
        if name == "secret_key":
            create = f"slipctl keys new {Path(place).stem} --dir {Path(place).parent}"
            mend = f"{create}. For clients of this machine alone, leave [bus] out"
        yield f"bus.{name}", f"{place} does not exist, so the daemon cannot start: {mend}"


def _is_visible(folder: Path) -> bool:
    """Return whether this user can see what a folder holds, or that it does not exist."""
    return os.access(folder, os.X_OK) or not os.path.lexists(folder)


def _endpoint_faults(name: str, endpoint: str | None, keys: str, bus: Bus) -> list[Fault]:
    if endpoint is None:
        return []
    if not _ENDPOINT.fullmatch(endpoint):
        return [(f"bus.{name}", f"must be ipc:///PATH or tcp://ADDRESS:PORT, got {endpoint!r}")]
    local = bool(_LOCAL.match(endpoint))
    if endpoint.startswith("ipc:") or getattr(bus, keys) is not None or (local and bus.allow_local_tcp):
        return []
    who = "every user of this machine" if local else "other machines"
    also = " or bus.allow_local_tcp = true," if local else ""
    fault = f"{who} could connect without a key: set bus.secret_key and bus.{keys},{also} or use ipc:///PATH"
    return [(f"bus.{name}", fault)]
