"""Faults of ``[bus]``: endpoints that cannot be served, and endpoints that would admit anybody."""

from __future__ import annotations

import re

from slipd.config.model import Bus, Config

Fault = tuple[str, str]
_ENDPOINT = re.compile(r"ipc:///[^\0]+|tcp://(\d{1,3}(\.\d{1,3}){3}|localhost|\*):(\d{1,5}|\*)")
_LOCAL = re.compile(r"tcp://(127\.|localhost:)")


def bus_faults(config: Config) -> list[Fault]:
    """Find endpoints that cannot be served or would admit anybody; faults that only binding shows come later."""
    bus = config.bus
    faults = _endpoint("publish", bus.publish, "readers", bus) + _endpoint("requests", bus.requests, "requesters", bus)
    lists = [name for name in ("readers", "requesters") if getattr(bus, name) is not None]
    if bus.secret_key is None:
        faults += [(f"bus.{name}", "needs bus.secret_key, the daemon's own key") for name in lists]
    elif not lists:
        faults.append(
            ("bus.secret_key", "needs bus.readers, bus.requesters or both: without a list no client is asked for a key")
        )
    return faults


def _endpoint(name: str, endpoint: str | None, keys: str, bus: Bus) -> list[Fault]:
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
