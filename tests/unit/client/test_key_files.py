"""Key files: who may read them, and the commands that make and list them."""

from __future__ import annotations

import json
import os
import shutil
import stat
from collections.abc import Callable
from pathlib import Path

import pytest
import zmq
import zmq.auth

from slipd_client.keys import KeyFileError, Keys, create, load, load_allowed, load_public, load_secret

Call = Callable[..., tuple[int, str, str]]


@pytest.mark.parametrize("umask", [0o000, 0o022, 0o077])
def test_a_secret_is_for_its_user_alone_and_both_are_read_here_and_by_the_tools_of_zeromq(
    umask: int, tmp_path: Path
) -> None:
    before = os.umask(umask)
    try:
        public, secret = create("robot-1", tmp_path / "deep" / "keys")
    finally:
        os.umask(before)
    assert [stat.S_IMODE(path.stat().st_mode) for path in (secret, public, secret.parent)] == [0o600, 0o644, 0o700]
    pair = load_secret(secret)
    assert pair == zmq.auth.load_certificate(secret)
    assert zmq.auth.load_certificate(public) == (load_public(public), None) == (pair[0], None)
    found = load(secret, public)
    assert (found, found.secret.decode() in repr(found)) == (Keys(*pair, pair[0]), False)


@pytest.mark.parametrize("suffix", [".key", ".key_secret"])
def test_a_key_is_never_overwritten_and_nothing_is_left_half_made(suffix: str, tmp_path: Path) -> None:
    (tmp_path / f"robot-1{suffix}").write_text("precious")
    with pytest.raises(KeyFileError, match="exists already"):
        create("robot-1", tmp_path)
    assert [file.read_text() for file in tmp_path.iterdir()] == ["precious"]


@pytest.mark.parametrize("name", ["", "..", "a/b", "/etc/passwd", "-x", "a\nb", "x" * 65, ".hidden", "é"])
def test_a_name_that_could_be_a_path_is_refused(name: str, tmp_path: Path) -> None:
    with pytest.raises(KeyFileError, match="name must consist of"):
        create(name, tmp_path)
    assert list(tmp_path.iterdir()) == []


root_alone = pytest.mark.skipif(os.geteuid() != 0, reason="only root gives files away")


def given(path: Path) -> None:
    os.chown(path, 12345, 12345)


def opened(mode: int) -> Callable[[Path], None]:
    return lambda path: path.chmod(mode)


def of_another(path: Path) -> None:
    path.write_text(path.read_text().replace(load_secret(path)[0].decode(), zmq.curve_keypair()[0].decode()))


def holds(text: bytes) -> Callable[[Path], None]:
    return lambda path: path.write_bytes(text)


@pytest.mark.parametrize(
    ("load_it", "name", "change", "why"),
    [
        *((load_secret, "a.key_secret", opened(mode), f"mode {mode:04o}.*chmod 600")
          for mode in (0o640, 0o604, 0o660, 0o601, 0o777)),
        pytest.param(load_secret, "a.key_secret", given, "it belongs to 12345", marks=root_alone),
        (load_secret, "a.key_secret", of_another, "must be that of the secret key"),
        (load_secret, "a.key_secret", Path.unlink, "No such file"),
        (load_secret, "a.key_secret", holds(b""), "must hold a secret key .*, but holds no key"),
        *((load_it, "a.key", holds(text), why)
          for load_it in (load_public, load_allowed)
          for text, why in (
              (b"", "must hold a public key"),
              (b"\xff\xfe\x00", "must hold a public key"),
              (b'public-key = "short"', "40 characters"),
              ('public-key = "{}"'.format("é" * 40).encode(), "40 characters"),
              (b'public-key = "%s"' % (b"~" * 40), "40 characters"),
              (b"#" * 5000, "at most 4096 bytes"))),
        *((load_allowed, ".", opened(mode), "keys: others must not write to it") for mode in (0o770, 0o707, 0o1777)),
        *((load_allowed, "a.key", opened(mode), "a.key: others must not write to it")
          for mode in (0o666, 0o660, 0o602)),
        *(pytest.param(load_allowed, name, given, "must belong to .*user 12345", marks=root_alone)
          for name in (".", "a.key")),
        (load_allowed, ".", shutil.rmtree, "No such file"),
    ],
)  # fmt: skip
def test_a_file_that_holds_no_key_or_that_others_may_use_is_refused(
    load_it: Callable[[Path], object], name: str, change: Callable[[Path], None], why: str, tmp_path: Path
) -> None:
    create("a", tmp_path / "keys")
    path = tmp_path / "keys" / name
    change(path)
    with pytest.raises(KeyFileError, match=why):
        load_it(path.parent if load_it is load_allowed and name != "." else path)


def test_those_allowed_are_the_public_keys_of_a_directory_also_of_root(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    public = {load_public(create(name, tmp_path)[0]) for name in ("a", "b")}
    (tmp_path / "README").write_text("not a key")
    if os.geteuid() == 0:
        monkeypatch.setattr(os, "geteuid", lambda: 12345)
    assert load_allowed(tmp_path) == public
    (tmp_path / "empty").mkdir()
    assert load_allowed(tmp_path / "empty") == frozenset()


def test_a_public_key_that_others_may_write_is_a_clients_own_matter(tmp_path: Path) -> None:
    public, secret = create("a", tmp_path)
    public.chmod(0o666)
    assert load_public(public) == load_secret(secret)[0]
    with pytest.raises(KeyFileError, match="must hold only a public key"):
        load_public(secret)


def test_keys_are_made_where_they_belong_and_no_secret_is_printed(
    tmp_path: Path, call: Call, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    code, made, _ = call("keys", "new", "robot-1")
    public, secret = load_secret(tmp_path / "slipd" / "keys" / "robot-1.key_secret")
    assert (code, secret.decode() in made) == (0, False)
    assert load_public(tmp_path / "slipd" / "keys" / "robot-1.key") == public
    code, _, errors = call("keys", "new", "robot-1")
    assert (code, "exists already" in errors) == (2, True)
    code, made, _ = call("keys", "new", "other", "--json")
    assert (code, json.loads(made)["public_file"]) == (0, f"{tmp_path}/slipd/keys/other.key")
