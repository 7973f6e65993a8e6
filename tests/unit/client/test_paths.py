from __future__ import annotations

import os

import pytest

from slipd_client.paths import publish_endpoint, requests_endpoint, runtime_dir


@pytest.fixture(autouse=True)
def _bare(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("SLIPD_RUNTIME_DIR", raising=False)
    monkeypatch.delenv("XDG_RUNTIME_DIR", raising=False)


def test_without_a_session_the_directory_is_the_users_own_in_tmp() -> None:
    assert str(runtime_dir()) == f"/tmp/slipd-{os.getuid()}"


def test_a_session_has_its_own_directory(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", "/run/user/7")
    assert str(runtime_dir()) == "/run/user/7/slipd"


def test_the_variable_of_slipd_rules(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", "/run/user/7")
    monkeypatch.setenv("SLIPD_RUNTIME_DIR", "/run/slipd")
    assert publish_endpoint() == "ipc:///run/slipd/publish"
    assert requests_endpoint() == "ipc:///run/slipd/requests"


def test_an_empty_variable_is_none(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SLIPD_RUNTIME_DIR", "")
    monkeypatch.setenv("XDG_RUNTIME_DIR", "")
    assert str(runtime_dir()).startswith("/tmp/")
