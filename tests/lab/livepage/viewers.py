"""What the live view costs the daemon, and what a browser gets of it.

    PYTHONPATH=tests/support:tests/lab python -m livepage.viewers [--rounds 4] [--viewers 10]

Median time from the last byte of a reading to its message in a subscriber: with viewers, without, with, without, … so
that a busy machine meets both alike. Then one real browser: first paint, frames a second, and how soon it says "stale".
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import json
import os
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import urlsplit

from browser import Browser
from websockets.asyncio.client import connect

from slipd import config
from slipd_client.subscriber import Subscriber

READINGS = 4000
"""Verdicts of one measurement: 2.5 s of both fingers."""

TOPICS = ("",)
BROWSER_S = 5.0


@contextlib.contextmanager
def rig(folder: Path) -> Iterator[tuple[str, str, subprocess.Popen[str]]]:
    """The virtual gripper, a daemon that publishes every reading, and the view; endpoint, address, the daemon."""
    text = config.shipped("demo.toml").read_text(encoding="utf-8").replace('"virtual/', f'"{folder}/')
    (folder / "rig.toml").write_text(text + "\n[rates]\nslip_hz = 1000.0\nwrench_hz = 1000.0\n", encoding="utf-8")
    publish, requests = f"ipc://{folder}/run/publish", f"ipc://{folder}/run/requests"
    view = ("slipd_client.slipctl", "--publish", publish, "--requests", requests, "view", "--listen", "127.0.0.1:0")
    with contextlib.ExitStack() as stack:
        stack.enter_context(part(folder, "slipd.tools.sim.virtual_gripper", "--dir", str(folder))[0])
        daemon, _ = part(folder, "slipd", "run", "--config", str(folder / "rig.toml"))
        process = stack.enter_context(daemon)
        serving, line = part(folder, *view)
        stack.enter_context(serving)
        yield publish, line.partition(": ")[2], process


def part(
    folder: Path, name: str, *arguments: str
) -> tuple[contextlib.AbstractContextManager[subprocess.Popen[str]], str]:
    """Start a part; return it, to be ended, and its first line."""
    command = [sys.executable, "-m", name, *arguments]
    environment = os.environ | {"SLIPD_RUNTIME_DIR": str(folder / "run")}
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.DEVNULL}
    process = subprocess.Popen(command, text=True, env=environment, **pipes)
    assert process.stdout is not None
    return ending(process), process.stdout.readline().strip()


@contextlib.contextmanager
def ending(process: subprocess.Popen[str]) -> Iterator[subprocess.Popen[str]]:
    with process:
        yield process
        process.terminate()


def latencies_ms(publish: str) -> list[float]:
    """Return the latency of the next verdicts, ms."""
    found: list[float] = []
    with Subscriber(publish, TOPICS) as subscriber:
        for message in subscriber:
            if message.topic.startswith("slip."):
                found.append(message.age_s * 1e3)
            if len(found) == READINGS:
                break
    return found


async def look(url: str, viewers: int) -> None:
    """Show the page in browsers without a screen until standard input closes; print frames a second and their size."""
    sizes: list[int] = []
    began_s = time.monotonic()
    tasks = [asyncio.create_task(_view(url, sizes)) for _ in range(viewers)]
    await asyncio.to_thread(sys.stdin.read)
    print(f"{len(sizes) / (time.monotonic() - began_s) / viewers:.1f} frames/s of {statistics.mean(sizes):.0f} bytes")
    for task in tasks:
        task.cancel()
    await asyncio.gather(*tasks, return_exceptions=True)


async def _view(url: str, sizes: list[int]) -> None:
    """Ask for the next frame as soon as one has arrived."""
    where = urlsplit(url)
    async with connect(f"ws://{where.netloc}/live", origin=f"http://{where.netloc}") as socket:  # type: ignore[arg-type]
        await socket.send(where.fragment)
        await socket.send("next")
        async for text in socket:
            if "topics" in json.loads(text):
                sizes.append(len(text))
                await socket.send("next")


@contextlib.contextmanager
def looking(url: str, viewers: int) -> Iterator[subprocess.Popen[str]]:
    """Viewers in a process of their own; close its input to end them."""
    command = [sys.executable, "-m", "livepage.viewers", "--viewers", str(viewers), "--look", url]
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
    with subprocess.Popen(command, text=True, env=os.environ, **pipes) as process:
        time.sleep(1.5)
        yield process


def compare(publish: str, url: str, rounds: int, viewers: int) -> None:
    """Print the medians with viewers and without, round by round, and their ratio."""
    with_ms, without_ms = [], []
    for _ in range(rounds):
        with looking(url, viewers) as process:
            with_ms.append(statistics.median(latencies_ms(publish)))
            shown, _ = process.communicate()
        time.sleep(0.5)
        without_ms.append(statistics.median(latencies_ms(publish)))
        text = f"{viewers} viewers {with_ms[-1]:.3f} ms, none {without_ms[-1]:.3f} ms; each viewer {shown.strip()}"
        print(text, flush=True)
    a, b = statistics.median(with_ms), statistics.median(without_ms)
    print(f"median of the rounds: {viewers} viewers {a:.3f} ms, none {b:.3f} ms, ratio {a / b:.3f}")


def browse(url: str, daemon: subprocess.Popen[str]) -> None:
    """Print what one browser gets."""
    with Browser(1440, 1000) as browser:
        browser.open(url)
        paint = "performance.getEntriesByName('first-contentful-paint')[0]?.startTime"
        print(f"first paint after {browser.until(paint):.0f} ms")
        size = "performance.getEntriesByType('resource').reduce((sum, each) => sum + each.encodedBodySize, 0)"
        print(f"page and assets: {browser.value(size) / 1000:.0f} kB")
        browser.until("document.getElementById('connection').dataset.state === 'live'")
        before = browser.value("slipd.frames")
        time.sleep(BROWSER_S)
        print(f"frames drawn: {(browser.value('slipd.frames') - before) / BROWSER_S:.1f} a second")
        watch = """new Promise((done) => { const look = () => document.getElementById('connection').dataset.state ===
            'stale' ? done(Date.now() / 1000) : setTimeout(look, 5); look(); })"""
        ended_s = time.time()
        daemon.send_signal(signal.SIGKILL)
        print(f"stale {browser.value(watch) - ended_s:.2f} s after the daemon was killed")


def main() -> int:
    """Measure and print; return the exit code."""
    parser = argparse.ArgumentParser(prog="python -m livepage.viewers", description=__doc__)
    parser.add_argument("--rounds", type=int, default=4, metavar="N")
    parser.add_argument("--viewers", type=int, default=10, metavar="N")
    parser.add_argument("--look", default="", metavar="URL", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.look:
        asyncio.run(look(options.look, options.viewers))
        return 0
    with tempfile.TemporaryDirectory() as folder, rig(Path(folder)) as (publish, url, daemon):
        compare(publish, url, options.rounds, options.viewers)
        browse(url, daemon)
    return 0


if __name__ == "__main__":
    sys.exit(main())
