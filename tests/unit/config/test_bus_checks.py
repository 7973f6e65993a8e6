"""An endpoint that cannot be served, or that would admit anybody, is refused."""

from __future__ import annotations

import pytest
from config_faults import GOOD, faults

from slipd import config


@pytest.mark.parametrize("endpoint", ["tcp://0.0.0.0:5555", "bogus", "ipc://", "ipc://relative", "tcp://127.0.0.1"])
def test_an_endpoint_that_cannot_be_served_is_refused(endpoint: str) -> None:
    [(path, at, message)] = faults(f'{GOOD}\n[bus]\npublish = "{endpoint}"\n')
    assert path == "bus.publish"
    assert at == len(GOOD.splitlines()) + 3
    assert "ipc:///PATH" in message


@pytest.mark.parametrize("endpoint", ["tcp://127.0.0.1:5555", "tcp://localhost:*", "ipc:///run/slipd/publish"])
def test_an_endpoint_that_can_be_served_is_accepted(endpoint: str) -> None:
    bus = f'[bus]\nrequests = "{endpoint}"\nallow_local_tcp = true\n'
    assert config.parse(f"{GOOD}\n{bus}", "rig.toml").bus.requests == endpoint


SECRET, READERS, REQUESTERS = (f'{key} = "/etc/slipd/{key}"\n' for key in ("secret_key", "readers", "requesters"))


@pytest.mark.parametrize(
    ("bus", "wrong"),
    [
        ('publish = "tcp://*:5555"', ["bus.publish"]),
        ('publish = "tcp://*:5555"\nallow_local_tcp = true', ["bus.publish"]),
        ('publish = "tcp://127.0.0.1:5555"', ["bus.publish"]),
        ('requests = "tcp://10.0.0.7:*"', ["bus.requests"]),
        (f'requests = "tcp://10.0.0.7:*"\n{SECRET}{READERS}', ["bus.requests"]),
        (f'publish = "tcp://10.0.0.7:*"\n{SECRET}{REQUESTERS}', ["bus.publish"]),
        (f'requests = "tcp://10.0.0.7:*"\n{SECRET}{REQUESTERS}', []),
        (f'publish = "tcp://*:*"\nrequests = "tcp://*:*"\n{SECRET}{READERS}{REQUESTERS}', []),
        (f'requests = "tcp://10.0.0.7:*"\n{REQUESTERS}', ["bus.requesters"]),
        (SECRET, ["bus.secret_key"]),
        ('secret_key = "relative"', ["bus.secret_key"]),
        ("requests_hz = 0.0", ["bus.requests_hz"]),
    ],
)
def test_an_endpoint_over_tcp_needs_the_daemon_key_and_a_list_of_client_keys(bus: str, wrong: list[str]) -> None:
    text = f"{GOOD}\n[bus]\n{bus}\n"
    if wrong:
        assert [path for path, _, _ in faults(text)] == wrong
    else:
        config.parse(text, "rig.toml")
