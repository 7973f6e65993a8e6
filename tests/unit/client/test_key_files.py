"""Key files: who may read them, and the commands that make and list them."""

from __future__ import annotations

import json
import os
import stat
from collections.abc import Callable
from pathlib import Path

import pytest
import zmq
import zmq.auth

from slipd_client.keys import KeyFileError, Keys, create, load, load_allowed, load_public, load_secret

Call = Callable[..., tuple[int, str, str]]


@pytest.fixture
def made(tmp_path: Path) -> tuple[Path, Path]:
    return create("robot-1", tmp_path / "keys")


@pytest.mark.parametrize("umask", [0o000, 0o022, 0o077])
def test_a_secret_is_for_its_user_alone_and_the_public_key_for_all_whatever_the_umask(
    umask: int, tmp_path: Path
) -> None:
    before = os.umask(umask)
    try:
        public, secret = create("robot-1", tmp_path / "deep" / "keys")
    finally:
        os.umask(before)
    assert [stat.S_IMODE(path.stat().st_mode) for path in (secret, public, secret.parent)] == [0o600, 0o644, 0o700]
    assert "secret-key" not in public.read_text()


def test_what_is_made_can_be_read_here_and_by_the_tools_of_zeromq(made: tuple[Path, Path]) -> None:
    public, secret = made
    pair = load_secret(secret)
    assert pair == zmq.auth.load_certificate(secret)
    assert load_public(public) == pair[0] == zmq.auth.load_certificate(public)[0]
    assert zmq.curve_public(pair[1]) == pair[0]


def test_a_client_has_its_own_keys_and_the_daemons_public_one(made: tuple[Path, Path], tmp_path: Path) -> None:
    server, _ = create("server", tmp_path)
    found = load(made[1], server)
    assert found == Keys(*load_secret(made[1]), load_public(server))
    assert found.secret.decode() not in repr(found)


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


@pytest.mark.parametrize("loose", [0o640, 0o604, 0o660, 0o601, 0o777])
def test_a_secret_that_others_may_use_is_refused(loose: int, made: tuple[Path, Path]) -> None:
    made[1].chmod(loose)
    with pytest.raises(KeyFileError, match=f"mode {loose:04o}.*chmod 600"):
        load_secret(made[1])


@pytest.mark.skipif(os.geteuid() != 0, reason="only root gives files away")
def test_a_secret_of_another_user_is_refused(made: tuple[Path, Path]) -> None:
    os.chown(made[1], 12345, -1)
    with pytest.raises(KeyFileError, match="it belongs to 12345"):
        load_secret(made[1])


@pytest.mark.parametrize(
    ("text", "wrong"),
    [
        (b"", "must hold a public key"),
        (b"\xff\xfe\x00", "must hold a public key"),
        (b'public-key = "short"', "40 characters"),
        ('public-key = "{}"'.format("é" * 40).encode(), "40 characters"),
        (b'public-key = "%s"' % (b"~" * 40), "40 characters"),
        (b"#" * 5000, "at most 4096 bytes"),
    ],
)
def test_a_file_that_holds_no_key_is_refused(text: bytes, wrong: str, tmp_path: Path) -> None:
    (tmp_path / "a.key").write_bytes(text)
    with pytest.raises(KeyFileError, match=wrong):
        load_public(tmp_path / "a.key")
    with pytest.raises(KeyFileError, match=wrong):
        load_allowed(tmp_path)


def test_a_pair_that_does_not_belong_together_is_refused(made: tuple[Path, Path]) -> None:
    made[1].write_text(made[1].read_text().replace(load_public(made[0]).decode(), zmq.curve_keypair()[0].decode()))
    with pytest.raises(KeyFileError, match="must be that of the secret key"):
        load_secret(made[1])


@pytest.mark.parametrize("load_it", [load_secret, load_allowed])
def test_a_file_that_is_not_there_is_told(load_it: Callable[[Path], object], tmp_path: Path) -> None:
    with pytest.raises(KeyFileError, match="No such file"):
        load_it(tmp_path / "nowhere")


def test_those_allowed_are_the_public_keys_of_a_directory(tmp_path: Path) -> None:
    public = {load_public(create(name, tmp_path)[0]) for name in ("a", "b")}
    (tmp_path / "README").write_text("not a key")
    assert load_allowed(tmp_path) == public
    (tmp_path / "empty").mkdir()
    assert load_allowed(tmp_path / "empty") == frozenset()


@pytest.mark.parametrize("loose", [0o770, 0o707, 0o1777, 0o666, 0o660, 0o602])
def test_a_list_to_which_others_may_add_or_of_which_they_may_write_a_key_is_refused(
    loose: int, made: tuple[Path, Path]
) -> None:
    theirs = made[0].parent if loose & 0o111 else made[0]
    theirs.chmod(loose)
    with pytest.raises(KeyFileError, match=f"{theirs}: others must not write to it"):
        load_allowed(made[0].parent)
    assert load_public(made[0]), "a client's own copy is its own matter"


@pytest.mark.skipif(os.geteuid() != 0, reason="only root gives files away")
@pytest.mark.parametrize("theirs", [".", "a.key"])
def test_a_list_of_another_user_is_refused(theirs: str, tmp_path: Path) -> None:
    create("a", tmp_path)
    os.chown(tmp_path / theirs, 12345, 12345)
    with pytest.raises(KeyFileError, match=rf"{(tmp_path / theirs).name}: must belong to .*user 12345"):
        load_allowed(tmp_path)


def test_a_list_of_root_is_taken_by_everybody(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    public, _ = create("a", tmp_path)
    if os.geteuid() == 0:
        monkeypatch.setattr(os, "geteuid", lambda: 12345)
    assert load_allowed(tmp_path) == {load_public(public)}


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
