"""Addresses to listen on."""

from __future__ import annotations

import argparse
import socket

import pytest

from slipd_client.arguments import parse_listen


@pytest.mark.parametrize(
    "text", ["", "8710", "127.0.0.1", "127.0.0.1:", "127.0.0.1:65536", "a b:1", "http://x:1", "::1:80"]
)
def test_what_is_not_host_and_port_is_refused_with_an_example(text: str) -> None:
    with pytest.raises(argparse.ArgumentTypeError, match=r"must be HOST:PORT, e.g. 127.0.0.1:8710, got"):
        parse_listen(text)


@pytest.mark.parametrize(
    ("text", "loopback", "url"),
    [
        ("127.0.0.1:80", True, "http://127.0.0.1:99/"),
        ("localhost:0", True, "http://localhost:99/"),
        ("[::1]:80", True, "http://[::1]:99/"),
        ("192.168.1.7:80", False, "http://192.168.1.7:99/"),
        ("0.0.0.0:80", False, f"http://{socket.gethostname()}:99/"),
        ("robot:80", False, "http://robot:99/"),
    ],
)
def test_a_listen_address_knows_its_url_and_whether_others_reach_it(text: str, loopback: bool, url: str) -> None:
    address = parse_listen(text)
    assert (address.loopback, address.url(99)) == (loopback, url)
