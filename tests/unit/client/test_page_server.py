"""Who may open the page, and what it serves."""

from __future__ import annotations

import asyncio
import http.client
import json
import socket
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from http import HTTPStatus
from urllib.parse import urlsplit

import pytest
from websockets.asyncio.client import connect
from websockets.asyncio.server import ServerConnection
from websockets.exceptions import ConnectionClosed, InvalidStatus

from slipd_client.arguments import ListenAddress
from slipd_client.errors import CallError
from slipd_client.page.page_server import ASSETS, WRONG_TOKEN, PageServer, Site, json_answer

LOOPBACK = ListenAddress("127.0.0.1", 0)
BUDGET_BYTES = 1_000_000


async def greet(connection: ServerConnection) -> None:
    await connection.send("welcome")


@asynccontextmanager
async def served(live: bool = True) -> AsyncIterator[str]:
    """A page with a WebSocket that greets, or with data; its address."""
    site = Site({"live": live})
    on_data = None if live else lambda path: json_answer(path) if path == "/data/some" else None
    async with PageServer(LOOPBACK, site, greet if live else None, on_data).serving() as url:
        yield url


async def get(url: str, path: str, **headers: str) -> tuple[int, bytes, dict[str, str]]:
    def ask() -> tuple[int, bytes, dict[str, str]]:
        where = urlsplit(url)
        connection = http.client.HTTPConnection(where.hostname or "", where.port, timeout=30)
        connection.putrequest("GET", path, skip_host="Host" in headers)
        for name, value in headers.items():
            connection.putheader(name, value)
        connection.endheaders()
        answer = connection.getresponse()
        found = answer.status, answer.read(), dict(answer.getheaders())
        connection.close()
        return found

    return await asyncio.to_thread(ask)


async def first_message(url: str, token: str, origin: str | None) -> str | bytes:
    where = urlsplit(url)
    async with connect(f"ws://{where.netloc}/live", origin=origin) as socket:  # type: ignore[arg-type]
        await socket.send(token)
        return await socket.recv()


async def test_every_file_of_the_page_is_served_within_the_budget() -> None:
    total = 0
    async with served() as url:
        for path in ("/", *(f"/{file.relative_to(ASSETS).as_posix()}" for file in ASSETS.rglob("*.*"))):
            status, body, headers = await get(url, path)
            served_file = not path.endswith("LICENSE")
            assert (status == HTTPStatus.OK) == served_file
            total += len(body)
            assert "default-src 'none'" in headers["Content-Security-Policy"]
            assert headers["X-Frame-Options"] == "DENY"
        status, body, _ = await get(url, "/settings.json", Authorization=f"Bearer {urlsplit(url).fragment}")
    assert json.loads(body)["words"]["levels"][0] == "no_contact"
    assert total + len(body) < BUDGET_BYTES


@pytest.mark.parametrize(
    "path", ["/nothing", "/../page_server.py", "/%2e%2e/site.py", "//etc/passwd", "/vendor/", "/data/some"]
)
async def test_nothing_else_is_served(path: str) -> None:
    async with served() as url:
        assert (await get(url, path))[0] == HTTPStatus.NOT_FOUND


@pytest.mark.parametrize(
    "host", ["evil.example", "evil.example:8710", "127.0.0.1.evil.example", "", "a b", "user@127.0.0.1"]
)
async def test_a_name_of_another_machine_is_refused(host: str) -> None:
    async with served() as url:
        assert (await get(url, "/", Host=host))[0] == HTTPStatus.FORBIDDEN


@pytest.mark.parametrize(
    "origin", [None, "null", "http://evil.example", "http://localhost:1", "http://127.0.0.1", "file://", "http://"]
)
async def test_a_page_of_another_site_is_kept_out_even_with_the_token(origin: str | None) -> None:
    async with served() as url:
        with pytest.raises(InvalidStatus) as refused:
            await first_message(url, urlsplit(url).fragment, origin)
    assert refused.value.response.status_code == HTTPStatus.FORBIDDEN


@pytest.mark.parametrize("token", ["", "wrong", "é"])
async def test_a_wrong_token_is_refused_with_the_reason(token: str) -> None:
    async with served() as url:
        with pytest.raises(ConnectionClosed) as closed:
            await first_message(url, token, f"http://{urlsplit(url).netloc}")
    assert closed.value.rcvd is not None
    assert closed.value.rcvd.code == WRONG_TOKEN
    assert "token" in closed.value.rcvd.reason


async def test_data_needs_the_token() -> None:
    async with served(live=False) as url:
        token = f"Bearer {urlsplit(url).fragment}"
        assert (await get(url, "/data/some"))[0] == HTTPStatus.UNAUTHORIZED
        assert (await get(url, "/data/some", Authorization="Bearer wrong"))[0] == HTTPStatus.UNAUTHORIZED
        assert (await get(url, "/data/some", Authorization=token))[:2] == (HTTPStatus.OK, b'"/data/some"')
        assert (await get(url, "/data/other", Authorization=token))[0] == HTTPStatus.NOT_FOUND
        assert (await get(url, "/live"))[0] == HTTPStatus.NOT_FOUND


async def test_the_settings_name_the_source_only_to_who_has_the_token() -> None:
    async with served() as url:
        for headers in ({}, {"Authorization": "Bearer wrong"}):
            status, body, _ = await get(url, "/settings.json", **headers)
            assert status == HTTPStatus.UNAUTHORIZED
            assert b"live" not in body


async def test_a_port_in_use_is_an_error_that_names_another() -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        server = PageServer(ListenAddress("127.0.0.1", port), Site({}))
        with pytest.raises(CallError, match=rf"127.0.0.1:{port}.*in use.*--listen 127.0.0.1:0 takes any free port"):
            async with server.serving():
                pytest.fail("it was served")
