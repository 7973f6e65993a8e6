"""Emulated pads pressed by mouse in a real browser: emulation, daemon and the live view, each a process."""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from browser import MISSING, Browser

pytestmark = [pytest.mark.process, pytest.mark.skipif(bool(MISSING), reason=MISSING), pytest.mark.timeout(180)]

RIG = """
[finger.left]
mu = 0.5
min_normal_n = 1.5  # more than the bias of the emulated sensor

[finger.left.wrench]
device = "external"
port = "ipc:///nowhere/wrench"
sensor = "wrench"
rate_hz = 50.0
stale_s = 0.5
pad_from_sensor = { xyz_m = [0.0, 0.0, -0.02], quat_xyzw = [0.0, 0.0, 0.0, 1.0] }

[finger.left.pad]
device = "external"
port = "ipc:///nowhere/pad"
sensor = "pad"
rate_hz = 50.0
stale_s = 0.5
rows = 4
cols = 8
pitch_m = 0.004
electrode_m = 0.003
axis_scale = [1.0]
threshold = 0.06  # six times the noise of an emulated taxel
gain_error = 0.10
"""
SHOWN = """(() => {
    const number = (field) => Number.parseFloat(
        document.querySelector(`[data-field="left.${field}"]`).textContent.replace("−", "-"));
    const c_m = slipd.cards.get("left").drawn.slip?.centroid_m;
    return { normal_n: number("normal_n"), spin_nm: number("spin_nm"), c_m: c_m ?? [NaN, NaN] };
})()"""


@contextlib.contextmanager
def part(folder: Path, name: str, *arguments: str) -> Iterator[subprocess.Popen[str]]:
    """Run a part of the rig until the block ends."""
    with subprocess.Popen(
        [sys.executable, "-m", name, *arguments],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        text=True,
        env=os.environ | {"SLIPD_RUNTIME_DIR": str(folder / "run")},
    ) as process:
        try:
            yield process
        finally:
            process.terminate()


def first_line(process: subprocess.Popen[str]) -> str:
    assert process.stdout is not None
    return process.stdout.readline().strip()


def test_a_pad_is_pressed_by_mouse_until_its_emulator_dies(tmp_path: Path) -> None:
    (tmp_path / "rig.toml").write_text(RIG, encoding="utf-8")
    folder = tmp_path / "emulated"
    view = ("slipd_client.slipctl", "view", "--listen", "127.0.0.1:0", "--emulation", str(folder))
    emulate = ("slipd", "emulate", str(tmp_path / "rig.toml"), "--dir", str(folder))
    run = ("slipd", "run", "--config", str(folder / "rig.toml"))
    with contextlib.ExitStack() as stack:
        viewing, emulator = (stack.enter_context(part(tmp_path, *command)) for command in (view, emulate))
        browser = stack.enter_context(Browser())
        url = first_line(viewing).partition(": ")[2]
        assert first_line(emulator).startswith("external: ")
        first_line(stack.enter_context(part(tmp_path, *run)))
        browser.do(lambda page: page.goto(f"{url}x"))
        browser.until("document.getElementById('connection').dataset.state === 'refused'")
        assert browser.value("document.querySelector('.hand')") is None, "the token is wrong"
        browser.do(lambda page: page.goto("about:blank"))
        browser.open(url)
        browser.until("slipd.cards.get('left')?.drawn.tactile && document.querySelector('.hand') !== null")
        browser.press('[data-finger="left"] .tare', "left: zero taken of wrench")
        mouse(browser, "move", 0.0, 0.0)
        mouse(browser, "down")
        browser.until(f"(({{ normal_n, c_m }}) => Math.abs(normal_n - 5) < 0.3 && Math.hypot(...c_m) < 1e-3)({SHOWN})")
        mouse(browser, "move", 0.012, 0.006)
        mouse(browser, "up")
        browser.do(lambda page: page.mouse.wheel(0, -100))
        set_slider(browser, "twist_mnm", 12)
        set_slider(browser, "push_y_n", -1.5)
        browser.until(
            f"""(({{ normal_n, spin_nm, c_m }}) => Math.abs(normal_n - 5.5) < 0.3 && Math.abs(spin_nm - 0.012) < 2e-3
                && Math.hypot(c_m[0] - 0.012, c_m[1] - 0.006) < 2e-3)({SHOWN})"""
        )
        browser.click(".hand button")
        browser.until(f"Math.abs({SHOWN}.normal_n) < 0.3")
        emulator.kill()
        browser.until("document.querySelector('.hand') === null && document.querySelector('.touchable') === null")
        assert browser.value("document.getElementById('reply').textContent").startswith("the emulation has ended")
        stack.enter_context(part(tmp_path, *emulate))
        browser.until("document.querySelector('.hand') !== null && document.getElementById('reply').textContent === ''")
        assert all("401" in problem for problem in browser.problems), browser.problems


def mouse(browser: Browser, action: str, *place_m: float) -> None:
    """Move the mouse to a place of the left pad, or press or release its button."""
    where = """(([x, y]) => {
        const { pad, drawn } = slipd.cards.get("left");
        pad.scrollIntoView({ block: "center" });
        const { left, top } = pad.getBoundingClientRect();
        const { scale, origin } = drawn.pad;
        return [left + origin[0] + scale * x, top + origin[1] - scale * y];
    })"""
    at = browser.value(f"{where}({list(place_m)})") if place_m else []
    browser.do(lambda page: getattr(page.mouse, action)(*at))


def set_slider(browser: Browser, name: str, value: float) -> None:
    browser.do(lambda page: page.locator(f".hand input[name={name}]").fill(str(value)))
