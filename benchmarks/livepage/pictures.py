"""Pictures of the live view, made by a real browser while a recording of the demo is published.

    PYTHONPATH=tests/support:benchmarks python -m livepage.pictures [--into docs]

``live_view.png`` is the page while a finger warns, ``live_view_phone.png`` the same on a phone in the dark;
``live_view_hand.png`` is an emulated pad under the mouse, ``live_view_commission.png`` the page that commissions it.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from browser import MISSING, Browser
from emulated_rig import EmulatedRig
from project import DATA, DOCS

RECORDING = DATA / "replays" / "demo.mcap"
SPEED = "0.4"
PRESSED_PX: Any = {"x": 330, "y": 130}
"""Where the mouse presses, from the upper left of the picture of the pad."""

STEP = "document.getElementById('prompt').dataset.step"
TOUCHES = {"centre": "press left 6 N", "push_x": "press left 6 N at 0 0 mm; push left +x 2.5 N"}
"""What the hand does at the first steps of the commissioning."""

WARNS = """['left', 'right'].every((finger) => slipd.cards.get(finger)?.level.textContent === 'WARNING'
    && slipd.cards.get(finger).drawn.pad.pole?.inside)"""


def main() -> int:
    """Make the pictures; return the exit code."""
    parser = argparse.ArgumentParser(prog="python -m livepage.pictures", description=__doc__.splitlines()[0])
    parser.add_argument("--into", type=Path, default=DOCS, metavar="FOLDER", help="default docs")
    options = parser.parse_args()
    if MISSING:
        print(MISSING, file=sys.stderr)
        return 2
    take(options.into / "live_view.png", Browser(1280, 1150))
    take(options.into / "live_view_phone.png", Browser(390, 844, dark=True))
    take_emulated(options.into)
    return 0


def take(path: Path, window: Browser) -> None:
    """Publish the recording, and save what the window shows when both fingers warn."""
    with tempfile.TemporaryDirectory(prefix="slipd-") as folder, window as browser:
        environment = os.environ | {"SLIPD_RUNTIME_DIR": folder}
        python = [sys.executable, "-m"]
        view = [*python, "slipd_client.slipctl", "view", "--listen", "127.0.0.1:0"]
        replay = [*python, "slipd", "replay", str(RECORDING), "--publish", "--speed", SPEED]
        with ended(view, stdout=subprocess.PIPE, text=True, env=environment) as viewing:
            browser.open(viewing.stdout.readline().split()[1])
            with ended(replay, stdout=subprocess.DEVNULL, env=environment):
                browser.until(WARNS)
                save(browser, path)


def take_emulated(into: Path) -> None:
    """Press an emulated pad by mouse, then commission it, and save both pages."""
    with tempfile.TemporaryDirectory(prefix="slipd-") as folder, EmulatedRig(Path(folder)) as rig:
        with Browser(1000, 815) as browser:
            browser.open(rig.url)
            browser.until("slipd.cards.get('left')?.drawn.tactile && document.querySelector('.hand') !== null")
            browser.press(".tare", "left: zero taken of wrench")
            browser.until("slipd.cards.get('left').drawn.tactile?.tare_origin")  # the pad's zero is observed after it
            browser.do(lambda page: page.click(".pad", position=PRESSED_PX))
            browser.until("slipd.cards.get('left').drawn.slip?.normal_n > 4.5")
            save(browser, into / "live_view_hand.png")
        rig.touch("release")
        with Browser(1000, 500) as browser:
            browser.do(lambda page: page.goto(rig.url.replace("/#", "/commission#")))
            browser.until(f"{STEP} === 'begin'")
            browser.click("#choices [data-word=begin]")
            for step, command in TOUCHES.items():
                browser.until(f"{STEP} === '{step}'")
                rig.touch(command)
                browser.until("document.getElementById('newest').textContent.endsWith('Let go.')")
                rig.touch("release")
            browser.until(f"{STEP} === 'push_y'")
            save(browser, into / "live_view_commission.png")


def save(browser: Browser, path: Path) -> None:
    browser.do(lambda page: page.screenshot(path=path))
    print(path)


@contextlib.contextmanager
def ended(command: list[str], **options: Any) -> Iterator[subprocess.Popen[Any]]:
    """Run a program until the block ends."""
    with subprocess.Popen(command, **options) as process:
        try:
            yield process
        finally:
            process.terminate()


if __name__ == "__main__":
    sys.exit(main())
