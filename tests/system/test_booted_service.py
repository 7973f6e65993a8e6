"""The service as `sudo make install` leaves it, run by a real systemd, for the users of a real machine."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from booted_machine import PYTHON, SOURCE, BootedMachine, booted_machine, why_not
from project import ROOT
from rig_parts import wait_for

START_S = 600.0
"""Until the kernels are compiled, at most."""
WATCHDOG_S = 20.0
STATUS = "SLIPD_RUNTIME_DIR=/run/slipd slipctl status"

pytestmark = [
    pytest.mark.long,
    pytest.mark.timeout(1200),
    pytest.mark.skipif(bool(why_not()), reason=why_not()),
]


@pytest.fixture(scope="module")
def machine(tmp_path_factory: pytest.TempPathFactory) -> Iterator[BootedMachine]:
    """A machine on which docs/service.md was followed, with emulated devices."""
    with booted_machine(tmp_path_factory.mktemp("machine"), ROOT) as booted:
        for command in (
            f"make -C {SOURCE} install PYTHON={PYTHON}",
            "systemd-sysusers",
            "useradd -m -G slipd member && useradd -m stranger",
            "mkdir /srv/rig && chown slipd /srv/rig && slipd config show demo > /srv/demo.toml",
            "systemd-run --unit=emulation --uid=slipd --setenv=NUMBA_CACHE_DIR=/srv/rig/kernels"
            " slipd emulate /srv/demo.toml --dir /srv/rig",
            "for k in $(seq 300); do [ -s /srv/rig/demo.toml ] && exit; sleep 0.2; done; exit 1",
            "install -m 644 /srv/rig/demo.toml /etc/slipd/rig.toml",
            "systemctl daemon-reload && systemctl enable --now slipd",
        ):
            done = booted.run(command, timeout_s=START_S)
            log = booted.run("journalctl --no-pager -u slipd -u emulation | tail -20").stdout
            assert done.returncode == 0, f"{command}\n{done.stdout}{done.stderr}{log}"
        yield booted


@pytest.fixture
def active(machine: BootedMachine) -> BootedMachine:
    """The machine, once its service is ready."""
    wait_for(lambda: machine.show("slipd", "ActiveState") == "active", 30.0)
    return machine


def test_it_reads_every_stream(active: BootedMachine) -> None:
    wait_for(lambda: active.show("slipd", "StatusText").startswith("5 of 5 streams are read"), 10.0)


def test_members_of_its_group_are_answered_and_others_are_told_to_join(active: BootedMachine) -> None:
    asked = active.run(STATUS, user="member")
    assert (asked.returncode, asked.stderr) == (0, "")
    assert "left.wrench" in asked.stdout
    refused = active.run(STATUS, user="stranger")
    assert refused.returncode == 1
    assert "Only the group slipd may enter /run/slipd: sudo usermod -aG slipd $USER" in refused.stderr


def test_log_entries_name_their_stream(active: BootedMachine) -> None:
    assert "/srv/rig/left-pad" in active.run("journalctl --no-pager SLIPD_STREAM=left.pad").stdout


@pytest.mark.parametrize(("signal", "result"), [("KILL", "signal"), ("STOP", "watchdog")])
def test_P2_P5_a_daemon_that_dies_or_hangs_is_started_again(active: BootedMachine, signal: str, result: str) -> None:
    before = active.show("slipd", "MainPID")
    active.run(f"kill -{signal} {before}")
    wait_for(
        lambda: active.show("slipd", "MainPID") not in (before, "0") and active.show("slipd", "SubState") == "running",
        WATCHDOG_S,
    )
    assert f"Failed with result '{result}'" in active.run("journalctl --no-pager -u slipd | tail -40").stdout


def test_a_reload_with_faults_keeps_the_config_before(active: BootedMachine) -> None:
    config, before = "/etc/slipd/rig.toml", active.show("slipd", "MainPID")
    active.run(f"cp {config} /srv/kept.toml; echo 'bogus = 1' >> {config}; systemctl reload slipd")
    wait_for(lambda: "the config read before is kept" in active.show("slipd", "StatusText"), 10.0)
    active.run(f"cp /srv/kept.toml {config}; systemctl reload slipd")
    wait_for(lambda: "is kept" not in active.show("slipd", "StatusText"), 10.0)
    assert active.show("slipd", "MainPID") == before


def test_it_stops_cleanly_and_takes_its_sockets_along(active: BootedMachine) -> None:
    active.run("systemctl stop slipd")
    assert active.show("slipd", "Result") == "success"
    assert active.run("ls /run/slipd").returncode != 0
    active.run("systemctl start slipd")
