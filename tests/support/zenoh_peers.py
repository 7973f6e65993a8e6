"""A Zenoh router on loopback that can be killed and started again, and sessions that connect to it.

python -m zenoh_peers ENDPOINT      be a router until the standard input ends
"""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
from collections.abc import Iterator

import zenoh
from own_address import free_port, own_host

from slipd_client.fleet.fleet_network import Reach, configuration, opened


def free_endpoint() -> str:
    """Return an endpoint on loopback on which nobody listens."""
    return f"tcp/{own_host()}:{free_port()}"


@contextlib.contextmanager
def session(endpoint: str) -> Iterator[zenoh.Session]:
    """Connect to the router."""
    with opened(configuration(Reach([endpoint], []), "peer"), endpoint) as opened_session:
        yield opened_session


class Router(contextlib.AbstractContextManager["Router"]):
    """A process that is a router; use it in a ``with`` statement."""

    def __init__(self) -> None:
        self.endpoint = free_endpoint()
        self.start()

    def start(self) -> None:
        """Start it, and wait until it listens."""
        self._process = subprocess.Popen(
            [sys.executable, "-m", "zenoh_peers", self.endpoint],
            env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        assert self._process.stdout is not None
        assert self._process.stdout.readline() == "listening\n"

    @property
    def pid(self) -> int:
        """Id of the process."""
        return self._process.pid

    def kill(self) -> None:
        """Kill it."""
        self._process.kill()
        self._process.communicate()

    def __exit__(self, *_: object) -> None:
        self.kill()


def main() -> None:
    """Be a router until the standard input ends."""
    endpoint = sys.argv[1]
    with opened(configuration(Reach([], [endpoint]), "router"), endpoint):
        print("listening", flush=True)
        sys.stdin.read()


if __name__ == "__main__":
    main()
