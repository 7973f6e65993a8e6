"""``slipd commission`` as a person uses it: in a terminal, with a daemon that admits only keys, on emulated devices."""

from __future__ import annotations

from pathlib import Path

import pytest
from commission_person import TOUCHES
from commission_terminal import CommissionTerminal
from own_address import free_port, own_host

from slipd_client import keys

pytestmark = pytest.mark.process

RIG = """# One finger.
[finger.left]
min_normal_n = 1.5  # more than the bias of the emulated sensor

[finger.left.wrench]
device = "bota"
port = "/dev/serial/by-id/left"
rate_hz = 100.0
sign = -1
stale_s = 0.5
pad_from_sensor = { xyz_m = [0.004, -0.002, -0.025], quat_xyzw = [0.9659258, 0.2588190, 0.0, 0.0] }
"""
KEYED = """
[bus]
publish = "tcp://{host}:{publish}"
requests = "tcp://{host}:{requests}"
secret_key = "{folder}/daemon.key_secret"
readers = "{folder}/admitted"
requesters = "{folder}/admitted"
"""


def make_keys(folder: Path) -> str:
    """Create the keys of the daemon and of a person; return the part of the config."""
    admitted = folder / "admitted"
    admitted.mkdir(mode=0o700)
    keys.create("daemon", folder)
    public, _ = keys.create("person", folder)
    public.rename(admitted / public.name)
    return KEYED.format(host=own_host(), publish=free_port(), requests=free_port(), folder=folder)


def test_what_is_found_is_written_with_a_backup_where_the_daemon_admits_only_keys(tmp_path: Path) -> None:
    changes = {"# One finger.": make_keys(tmp_path), "sign = -1": "sign = 1  # MEASURE"}
    secret = str(tmp_path / "person.key_secret")
    with CommissionTerminal(tmp_path, RIG, changes, TOUCHES) as person:
        before, there = person.config.read_text(encoding="utf-8"), {*tmp_path.iterdir()}
        code = person.follow("--key", secret, until="Now restart the daemon")
        assert code == 130, "\n".join(person.lines)
        previous = tmp_path / "rig.toml.previous"
        assert {*tmp_path.iterdir()} - there == {previous}
        assert previous.read_text(encoding="utf-8") == before
        found = before.replace("sign = 1  # MEASURE", "sign = -1  # slipd commission")
        assert person.config.read_text(encoding="utf-8") == found
