"""Decide which keys may connect to which endpoint."""

from __future__ import annotations

import logging
from dataclasses import dataclass

from slipd.config import Bus, missing_keys
from slipd.errors import LinkError
from slipd.io.zmtp.endpoint import Access
from slipd.io.zmtp.mechanisms import decode_key
from slipd_client.keys import KeyFileError, load_allowed, load_secret

_log = logging.getLogger(__name__)


class AllowList:
    """The keys that may connect to one endpoint; a refusal is logged.

    Args:
        endpoint: Name of the endpoint, for the log.
        keys: The keys, 40 letters of Z85 each.
    """

    def __init__(self, endpoint: str, keys: frozenset[bytes]) -> None:
        self._endpoint, self._keys = endpoint, keys

    def admits(self, key: bytes) -> bool:
        """Return whether a key may connect."""
        allowed = key in self._keys
        if not allowed:
            _log.warning("%s: key %s is not allowed and was refused", self._endpoint, key.decode())
        return allowed


@dataclass(frozen=True, slots=True)
class Guard:
    """Access to both endpoints.

    Attributes:
        publish: Who may connect to the publish endpoint.
        requests: Who may connect to the request endpoint.
        requesters: The keys that may send requests; None: every connected client may.
    """

    publish: Access
    requests: Access
    requesters: frozenset[bytes] | None


def guard(bus: Bus) -> Guard:
    """Read the keys that the config names.

    The key of a reader may connect to the request endpoint too, where its requests get an error.

    Raises:
        LinkError: A key file cannot be used; the text says why, and how to create one that is missing.
    """
    if missing := list(missing_keys(bus)):
        raise LinkError("; ".join(f"{key}: {text}" for key, text in missing))
    try:
        secret = None if bus.secret_key is None else decode_key(load_secret(bus.secret_key)[1])
        readers = None if bus.readers is None else load_allowed(bus.readers)
        requesters = None if bus.requesters is None else load_allowed(bus.requesters)
    except KeyFileError as error:
        raise LinkError(str(error)) from error
    requests = None if requesters is None else requesters | (readers or frozenset())
    return Guard(_access(bus, "publish", secret, readers), _access(bus, "requests", secret, requests), requesters)


def _access(bus: Bus, endpoint: str, secret: bytes | None, keys: frozenset[bytes] | None) -> Access:
    if keys is None:
        return Access(local_tcp=bus.allow_local_tcp)
    return Access(secret, AllowList(endpoint, keys).admits, bus.allow_local_tcp)
