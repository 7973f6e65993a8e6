"""Emulated pads in a real browser: commissioned on the page, pressed by mouse; each part is a process of its own."""

from __future__ import annotations

import contextlib
import os
import socket
import subprocess
import sys
import time
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest
from browser import MISSING, PATIENCE_S, Browser
from commission_person import touch_for

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
sign = 1
pad_from_sensor = { xyz_m = [0.0, 0.0, -0.02], quat_xyzw = [0.0, 0.0, 0.0, 1.0] }

[finger.left.pad]
device = "external"
port = "ipc:///nowhere/pad"
sensor = "pad"
rate_hz = 50.0
stale_s = 0.5
rows = 4
cols = 8
flip_x = true
pitch_m = 0.004
electrode_m = 0.003
axis_scale = [1.0]
threshold = 0.06  # six times the noise of an emulated taxel
gain_error = 0.10
"""
WRONG = {"sign = 1": "sign = -1", "flip_x = true": "flip_x = false"}
"""How the daemon first believes that the sensors are mounted."""

TOUCHES = {
    "Press the centre": "press left 6 N",
    "Press the middle": "press left 6 N at 9 0 mm",
    "Press the corner": "press left 6 N at 9 3.5 mm",
    "push along +X": "press left 6 N at 0 0 mm; push left +x 2.5 N",
    "push along +Y": "press left 6 N at 0 0 mm; push left +y 2.5 N",
}
PROMPT = """(() => {
    const { textContent, dataset } = document.getElementById("prompt");
    return { text: textContent, kind: dataset.kind, step: dataset.step,
        log: [...document.querySelectorAll("#log li")].map((line) => line.textContent) };
})()"""
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


class EmulatedRig:
    """Emulation, daemon with a wrong config, the live view and a browser; ``with`` starts and ends them."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self.hand = folder / "emulated" / "hand"
        self.config = folder / "wrong.toml"
        self._stack = contextlib.ExitStack()

    def __enter__(self) -> EmulatedRig:
        (self._folder / "rig.toml").write_text(RIG, encoding="utf-8")
        listen = ("--listen", "127.0.0.1:0", "--emulation", str(self.hand.parent), "--config", str(self.config))
        viewing = self.start("slipd_client.slipctl", "view", *listen)
        self.emulator = self.emulate()
        self.browser = self._stack.enter_context(Browser())
        first_line(self.emulator)
        text = (self.hand.parent / "rig.toml").read_text(encoding="utf-8")
        for right, wrong in WRONG.items():
            text = text.replace(right, wrong)
        self.config.write_text(text, encoding="utf-8")
        self.daemon = self.run()
        self.url = first_line(viewing).partition(": ")[2]
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def emulate(self) -> subprocess.Popen[str]:
        return self.start("slipd", "emulate", str(self._folder / "rig.toml"), "--dir", str(self.hand.parent))

    def run(self) -> subprocess.Popen[str]:
        """Start the daemon, which serves once this returns."""
        daemon = self.start("slipd", "run", "--config", str(self.config))
        first_line(daemon)
        return daemon

    def start(self, *command: str) -> subprocess.Popen[str]:
        return self._stack.enter_context(part(self._folder, *command))

    def touch(self, command: str) -> None:
        with socket.socket(socket.AF_UNIX) as line, line.makefile("rw") as both:
            line.connect(str(self.hand))
            both.write(f"{command}\n")
            both.flush()
            assert both.readline() == "ok\n"


def first_line(process: subprocess.Popen[str]) -> str:
    assert process.stdout is not None
    return process.stdout.readline().strip()


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Iterator[EmulatedRig]:
    with EmulatedRig(tmp_path_factory.mktemp("emulation")) as rig:
        yield rig


def test_an_address_with_a_wrong_token_shows_and_touches_nothing(rig: EmulatedRig) -> None:
    browser = rig.browser
    for address in (f"{rig.url}x", rig.url.replace("/#", "/commission#") + "x"):
        browser.do(lambda page, address=address: page.goto(address))
        browser.until("document.getElementById('connection').dataset.state === 'refused'")
        assert browser.value("document.querySelector('.hand, #choices button[data-word=skip]')") is None
        browser.do(lambda page: page.goto("about:blank"))
    browser.problems.clear()  # the refusals


def test_a_wrong_sign_and_a_mirrored_image_are_found_on_the_page_and_written(rig: EmulatedRig) -> None:
    browser = rig.browser
    browser.do(lambda page: page.on("dialog", lambda dialog: dialog.accept()))
    browser.do(lambda page: page.goto(rig.url.replace("/#", "/commission#")))
    until_s, done, lines = time.monotonic() + PATIENCE_S, "", 0
    while (now := browser.value(PROMPT))["step"] != "write":
        assert now["kind"] != "error", now
        assert time.monotonic() < until_s, now
        for line in now["log"][lines:]:
            if touch_for(line) == "release":
                rig.touch("release")
        lines = len(now["log"])
        if now["step"] != done and (command := touch_for(now["text"], TOUCHES)) is not None:
            rig.touch(command)
            done = now["step"]
            assert browser.value(f"document.querySelector('.touch.asked')?.dataset.step === '{done}'")
        time.sleep(0.03)
    assert browser.value("document.querySelectorAll('#reading-rows tr').length") == 1
    assert "flip_x = true" in browser.value("document.getElementById('toml').textContent")
    wrong = rig.config.read_text(encoding="utf-8")
    browser.click("#choices [data-word=write]")
    browser.until("[...document.querySelectorAll('#log li')].some((line) => line.textContent.includes(': changed; '))")
    left = tomllib.loads(rig.config.read_text(encoding="utf-8"))["finger"]["left"]
    assert (left["wrench"]["sign"], left["pad"]["flip_x"]) == (1, True)
    assert rig.config.with_name("wrong.toml.previous").read_text(encoding="utf-8") == wrong
    assert browser.problems == []


def test_the_mouse_presses_the_pad_that_is_now_right(rig: EmulatedRig) -> None:
    browser = rig.browser
    rig.daemon.terminate()
    rig.daemon.wait(PATIENCE_S)
    rig.run()
    browser.open(rig.url)
    browser.until("slipd.cards.get('left')?.drawn.tactile && document.querySelector('.hand') !== null")
    browser.press('[data-finger="left"] .tare', "left: zero taken of wrench")
    mouse(browser, "move", 0.0, 0.0)
    mouse(browser, "down")
    browser.until(f"(({{ normal_n, c_m }}) => Math.abs(normal_n - 5) < 0.3 && Math.hypot(...c_m) < 1e-3)({SHOWN})")
    mouse(browser, "move", 0.010, 0.004)
    mouse(browser, "up")
    browser.do(lambda page: page.mouse.wheel(0, -100))
    set_slider(browser, "twist_mnm", 12)
    set_slider(browser, "push_y_n", -1.5)
    browser.until(
        f"""(({{ normal_n, spin_nm, c_m }}) => Math.abs(normal_n - 5.5) < 0.3 && Math.abs(spin_nm - 0.012) < 2e-3
            && Math.hypot(c_m[0] - 0.010, c_m[1] - 0.004) < 2e-3)({SHOWN})"""
    )
    browser.click(".hand button")
    browser.until(f"Math.abs({SHOWN}.normal_n) < 0.3")


def test_the_controls_go_with_the_emulator_and_come_again(rig: EmulatedRig) -> None:
    browser = rig.browser
    rig.emulator.kill()
    browser.until("document.querySelector('.hand') === null && document.querySelector('.touchable') === null")
    assert browser.value("document.getElementById('reply').textContent").startswith("the emulation has ended")
    rig.emulate()
    browser.until("document.querySelector('.hand') !== null && document.getElementById('reply').textContent === ''")
    assert browser.problems == []


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
