"""How the guide reaches the daemon of a config: endpoints, and keys where the daemon admits only those."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from slipd.config import Config
from slipd.errors import SlipdError
from slipd_client import keys
from slipd_client.errors import KeyFileError


@dataclass(frozen=True, slots=True)
class DaemonLink:
    """Endpoints of a daemon; None: the default ones. Keys are None where none are needed."""

    publish: str | None
    requests: str | None
    publish_keys: keys.Keys | None
    request_keys: keys.Keys | None


def link_to(
    rig: Config, publish: str | None, requests: str | None, key: Path | None, server_key: Path | None
) -> DaemonLink:
    """Return how to reach the daemon that runs a config.

    Args:
        rig: The config.
        publish: Where the daemon publishes; None: as the config states.
        requests: Where it accepts requests, likewise.
        key: File with the secret key of this client.
        server_key: File with the public key of the daemon; None: that beside the daemon's secret key.

    Raises:
        SlipdError: A key is needed and was not given, a file holds none, or a port is not known.
    """
    bus = rig.bus
    used = None
    if bus.readers is not None or bus.requesters is not None:
        if key is None:
            folders = " and ".join(dict.fromkeys(each for each in (bus.readers, bus.requesters) if each))
            raise SlipdError(
                "the daemon of this config admits only clients with keys: give --key FILE, the secret key of this "
                f"client, whose public key is in {folders} (slipctl keys new, docs/service.md)"
            )
        try:
            used = keys.load(key, server_key or Path(bus.secret_key or "").with_suffix(keys.PUBLIC_SUFFIX))
        except KeyFileError as error:
            raise SlipdError(f"{error}; the public key of the daemon is given with --server-key") from error
    elif key is not None or server_key is not None:
        raise SlipdError("the daemon of this config uses no keys; leave out --key and --server-key")
    return DaemonLink(
        _reachable(publish or bus.publish, "--publish"),
        _reachable(requests or bus.requests, "--requests"),
        used if bus.readers is not None else None,
        used if bus.requesters is not None else None,
    )


def _reachable(endpoint: str | None, option: str) -> str | None:
    """Return an endpoint to connect to, of one that may stand for all addresses of this machine."""
    if endpoint is None:
        return None
    if endpoint.startswith("tcp:") and endpoint.endswith(":*"):
        raise SlipdError(f"the config leaves the port of {endpoint} open: give {option} as slipd run printed it")
    return endpoint.replace("tcp://*:", "tcp://127.0.0.1:").replace("tcp://0.0.0.0:", "tcp://127.0.0.1:")
