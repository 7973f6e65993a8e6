"""The example exchange of docs/clients.md, with the daemon and an emulated gripper that holds an object."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest
from project import ROOT
from rig_parts import wait_for
from viewed_rig import ViewedRig, leased

pytestmark = pytest.mark.process

EXCHANGE = (ROOT / "clients" / "examples" / "exchange.py").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> ViewedRig:
    with ViewedRig(tmp_path_factory.mktemp("exchange")) as rig:
        yield rig


@pytest.mark.parametrize("kind", ["DEALER", "REQ"])
def test_the_exchange_grips_and_raises(kind: str, rig: ViewedRig, tmp_path: Path) -> None:
    program = tmp_path / "exchange.py"
    program.write_text(EXCHANGE.replace("zmq.DEALER", f"zmq.{kind}"), encoding="utf-8")

    def printed() -> str:
        """What the program prints; nothing where a busy machine was too late for its lease, as the program says."""
        with rig.client() as client:
            leased(client, lambda: client.gripper_open(drop=True))
        done = subprocess.run(
            [sys.executable, program, rig.endpoints.requests], capture_output=True, text=True, timeout=60
        )
        print(done.stderr)
        return done.stdout if done.returncode == 0 else ""

    forces = re.findall(r"^(?:closing with|raised to) ([\d.]+) N$", wait_for(printed), re.MULTILINE)
    assert [float(force) for force in forces] == pytest.approx([8.0, 9.0], abs=0.2)
