"""Friction that a person measures, with the whole daemon on real lines."""

from __future__ import annotations

import asyncio
import random
import sys
import time
import tomllib

import numpy as np
import pytest
from daemon_peers import PATIENCE_S, Client, until
from service_rig import Rig, serving

from slipd.devices import bota

HZ = 100
MU_S, MU_D, HELD, SQUEEZE_N = 0.6, 0.45, 0.03, 10.0
PULL_S, SLIDE_S, LET_GO_S, REST_S = 1.0, 0.5, 0.3, 1.2
"""Someone pulls at the object again and again: how long until it slips, slides, is let go, and the next pull."""


class Hand:
    """Pulls an object that slips at MU_S and slides at MU_D; both devices of the rig tell it, in real time."""

    def __init__(self, rig: Rig) -> None:
        self._rig, self._rng = rig, random.Random(3)
        self._begin_s, self._sent = time.monotonic(), 0

    def ratio(self, t_s: float) -> float:
        """Tangential over normal force."""
        t_s = t_s % (REST_S + PULL_S + SLIDE_S + LET_GO_S) - REST_S
        if t_s < 0.0:
            return HELD
        if t_s < PULL_S:
            return HELD + (MU_S - HELD) * t_s / PULL_S
        t_s -= PULL_S + SLIDE_S
        return MU_D if t_s < 0.0 else max(MU_D * (1.0 - t_s / LET_GO_S), HELD)

    def feel(self) -> None:
        """Send the readings that are due by now."""
        self._rig.wrench.hear()
        while self._sent < (time.monotonic() - self._begin_s) * HZ:
            if self._sent % 2 == 0:
                self._rig.pad.send_image()
            tangential_n = SQUEEZE_N * self.ratio(self._sent / HZ)
            force = np.array((tangential_n, 0.0, -SQUEEZE_N)) + [self._rng.gauss(0.0, 0.01) for _ in range(3)]
            torque = [self._rng.gauss(0.0, 1e-4) for _ in range(3)]
            self._sent += 1
            self._rig.wrench.send(bota.encode_frame(force, torque, round(1e6 / HZ) * self._sent))

    async def work(self) -> None:
        """Feel for ever."""
        while True:
            self.feel()
            await asyncio.sleep(1.0 / HZ)


async def slipctl(daemon: Client, *arguments: str) -> tuple[int | None, str, str]:
    """Exit code, output and errors of ``slipctl``."""
    endpoints = daemon.endpoints
    process = await asyncio.create_subprocess_exec(
        *(sys.executable, "-m", "slipd_client.slipctl"),
        *("--publish", endpoints.publish, "--requests", endpoints.requests, *arguments),
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.PIPE,
    )
    out, errors = await asyncio.wait_for(process.communicate(), 2 * PATIENCE_S)
    return process.returncode, out.decode(), errors.decode()


async def test_friction_is_measured_by_pulling_and_nothing_is_set(rig: Rig) -> None:
    async with serving(rig.config) as daemon:
        pulling = asyncio.create_task(Hand(rig).work())
        await until(lambda: daemon.hear("slip.left"))
        code, out, errors = await slipctl(daemon, "friction", "measure", "left", "--samples", "1")
        pulling.cancel()
        await asyncio.wait([pulling])
        status = daemon.hear("status")[-1]
    assert (code, errors) == (0, ""), out
    found = tomllib.loads(out[out.index("[finger") :])["finger"]["left"]
    assert found["mu"] == pytest.approx(MU_S * (1.0 - found["mu_spread"]), rel=0.02)
    assert found["mu_spread"] == 0.093, "of one pull, the usual one"
    [shown] = [line for line in out.splitlines() if line.startswith("left: static friction")]
    dynamic = float(shown.partition("dynamic friction ")[2].partition(". For")[0])
    assert dynamic == pytest.approx(MU_D, rel=0.02)
    assert status["fingers"]["left"]["mu_by"] is None
    assert status["lease"]["held"] is False
