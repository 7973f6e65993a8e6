"""Faults of ``[bus]``: endpoints that no daemon could serve, and those that would let in anybody."""

from __future__ import annotations

import re

from slipd.config_model import Bus, Config

Fault = tuple[str, str]
_ENDPOINT = re.compile(r"ipc:///[^\0]+|tcp://(\d{1,3}(\.\d{1,3}){3}|localhost|\*):(\d{1,5}|\*)")
_LOCAL = re.compile(r"tcp://(127\.|localhost:)")


def bus_faults(config: Config) -> list[Fault]:
    """Find endpoints that no daemon could serve, or that let in anybody; what only binding shows is judged then."""
    bus = config.bus
    faults = _endpoint("publish", bus.publish, "readers", bus) + _endpoint("requests", bus.requests, "requesters", bus)
    lists = [name for name in ("readers", "requesters") if getattr(bus, name) is not None]
    if bus.secret_key is None:
        faults += [(f"bus.{name}", "needs bus.secret_key, the daemon's own key") for name in lists]
    elif not lists:
        faults.append(("bus.secret_key", "asks nobody for a key; set bus.readers, bus.requesters or both as well"))
    return faults


def _endpoint(name: str, endpoint: str | None, keys: str, bus: Bus) -> list[Fault]:
    if endpoint is None:
        return []
    if not _ENDPOINT.fullmatch(endpoint):
        return [(f"bus.{name}", f"{endpoint!r} is no endpoint that is served: ipc:///PATH, or tcp://ADDRESS:PORT")]
    local = bool(_LOCAL.match(endpoint))
    if endpoint.startswith("ipc:") or getattr(bus, keys) is not None or (local and bus.allow_local_tcp):
        return []
    who = "every user of this machine" if local else "other machines"
    also = " or bus.allow_local_tcp = true," if local else ""
    fault = f"{who} would get in without a key; set bus.secret_key and bus.{keys},{also} or use ipc:///PATH"
    return [(f"bus.{name}", fault)]
