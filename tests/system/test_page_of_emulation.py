"""Emulated pads in a real browser: commissioned on the page, pressed by mouse and keyboard; each part is a process."""

from __future__ import annotations

import signal
import time
import tomllib
from collections.abc import Iterator

import pytest
from browser import MISSING, PATIENCE_S, Browser
from commission_person import touch_for
from emulated_rig import WRONG, EmulatedRig
from rig_parts import endpoints_of

pytestmark = [pytest.mark.process, pytest.mark.skipif(bool(MISSING), reason=MISSING), pytest.mark.timeout(180)]

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
        asked: document.querySelector(".touch.asked")?.dataset.step,
        log: [...document.querySelectorAll("#log li")].map((line) => line.textContent) };
})()"""
SHOWN = """(() => {
    const number = (field) => Number.parseFloat(
        document.querySelector(`[data-field="left.${field}"]`).textContent.replace("−", "-"));
    const c_m = slipd.cards.get("left").drawn.slip?.centroid_m;
    return { normal_n: number("normal_n"), spin_nm: number("spin_nm"), c_m: c_m ?? [NaN, NaN] };
})()"""


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Iterator[EmulatedRig]:
    with EmulatedRig(tmp_path_factory.mktemp("emulation"), WRONG) as rig:
        yield rig


@pytest.fixture(scope="module")
def mounted(rig: EmulatedRig) -> EmulatedRig:
    """The rig once its daemon has read the config by which the devices are mounted."""
    rig.write_config()
    rig.daemon.send_signal(signal.SIGHUP)
    endpoints_of(rig.daemon)
    return rig


def test_an_address_with_a_wrong_token_shows_and_touches_nothing(rig: EmulatedRig, browser: Browser) -> None:
    for address in (f"{rig.url}x", rig.url.replace("/#", "/commission#") + "x"):
        browser.do(lambda page, address=address: page.goto(address))
        browser.until("document.getElementById('connection').dataset.state === 'refused'")
        assert browser.value("document.querySelector('.hand, #choices button[data-word=skip]')") is None
        browser.do(lambda page: page.goto("about:blank"))
    browser.problems.clear()  # the refusals


def test_a_wrong_sign_and_a_mirrored_image_are_found_on_the_page_and_written(
    rig: EmulatedRig, browser: Browser
) -> None:
    browser.do(lambda page: page.on("dialog", lambda dialog: dialog.accept()))
    browser.do(lambda page: page.goto(rig.url.replace("/#", "/commission#")))
    browser.until(f"{PROMPT}.step === 'begin'")
    assert browser.value(PROMPT)["log"] == [], "an open page takes no zero"
    browser.click("#choices [data-word=begin]")
    until_s, done, lines = time.monotonic() + 3 * PATIENCE_S, "begin", 0
    while (now := browser.value(PROMPT))["step"] != "write":
        assert (now["kind"] != "error", time.monotonic() < until_s) == (True, True), now
        if any(touch_for(line) == "release" for line in now["log"][lines:]):
            rig.touch("release")
        lines = len(now["log"])
        if now["step"] != done and (command := touch_for(now["text"], TOUCHES)) is not None:
            assert now["asked"] == now["step"]
            rig.touch(command)
            done = now["step"]
        time.sleep(0.03)
    assert browser.value("document.querySelectorAll('#reading-rows tr').length") == 1
    assert "flip_x = true" in browser.value("document.getElementById('toml').textContent")
    wrong = rig.config.read_text(encoding="utf-8")
    browser.click("#choices [data-word=write]")
    browser.until("[...document.querySelectorAll('#log li')].some((line) => line.textContent.includes(': changed; '))")
    left = tomllib.loads(rig.config.read_text(encoding="utf-8"))["finger"]["left"]
    assert (left["wrench"]["sign"], left["pad"]["flip_x"]) == (1, True)
    assert rig.config.with_name("rig.toml.previous").read_text(encoding="utf-8") == wrong


def test_the_mouse_presses_a_pad_that_is_mounted_as_the_config_says(mounted: EmulatedRig, browser: Browser) -> None:
    browser.open(mounted.url)
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


def test_the_keyboard_presses_a_pad(mounted: EmulatedRig, browser: Browser) -> None:
    browser.leave()  # where the mouse was
    browser.open(mounted.url)
    browser.until("slipd.cards.get('left')?.drawn.tactile && document.querySelector('.touchable') !== null")
    assert browser.value("document.querySelector('.touchable').getAttribute('aria-label')").startswith(
        "emulated pad of"
    )
    browser.press('[data-finger="left"] .tare', "left: zero taken of wrench")
    browser.do(lambda page: page.focus('[data-finger="left"] .pad'))
    keys(browser, "Space")
    browser.until(f"(({{ normal_n, c_m }}) => Math.abs(normal_n - 5) < 0.3 && Math.hypot(...c_m) < 1e-3)({SHOWN})")
    keys(browser, *["ArrowRight"] * 11, "ArrowLeft", *["ArrowUp"] * 3, *["Shift+ArrowUp"] * 5, "PageUp", "PageUp")
    place = """document.querySelector(".hand [name=place]").textContent"""
    assert browser.value(place) == "(10.0, 4.0) mm"
    browser.until(
        f"""(({{ normal_n, c_m }}) => Math.abs(normal_n - 6) < 0.3 && Math.hypot(c_m[0] - 0.010, c_m[1] - 0.004) < 2e-3)
            ({SHOWN})"""
    )
    keys(browser, *["ArrowRight"] * 10, "Control+ArrowDown", "x")
    assert browser.value(place) == "(16.0, 4.0) mm", "the edge of the pad"
    keys(browser, "PageDown", "Space")
    browser.until(f"Math.abs({SHOWN}.normal_n) < 0.3")


@pytest.mark.long
def test_gravity_is_typed_on_the_page_where_a_pose_is_asked_for(rig: EmulatedRig, browser: Browser) -> None:
    browser.do(lambda page: page.goto(rig.url.replace("/#", "/commission#")))
    asked = "document.getElementById('prompt').dataset.step === '{}' && document.getElementById('typed').hidden === {}"
    browser.until(asked.format("begin", "true"))
    browser.click("#choices [data-word=begin]")
    browser.until(asked.format("centre", "true"))
    browser.click("#choices [data-word=skip]")
    browser.until(asked.format("tips_down", "false"))
    send_text(browser, "1 0")
    browser.until(f"{PROMPT}.log.some((line) => line.includes('an orientation must be three numbers'))")
    browser.until("document.getElementById('typed-text').value === ''")
    send_text(browser, "9.81, 0, 0")
    browser.until(asked.format("pad_up", "false"))


def test_the_controls_go_with_the_emulator_and_come_again(rig: EmulatedRig, browser: Browser) -> None:
    browser.open(rig.url)
    browser.until("document.querySelector('.hand') !== null && document.querySelector('.touchable') !== null")
    rig.emulator.kill()
    browser.until("document.querySelector('.hand') === null && document.querySelector('.touchable') === null")
    assert browser.value("document.getElementById('reply').textContent").startswith("the emulation has ended")
    rig.emulate()
    browser.until("document.querySelector('.hand') !== null && document.getElementById('reply').textContent === ''")


def mouse(browser: Browser, action: str, *place_m: float) -> None:
    """Move the mouse to a place of the left pad, or press or release its button."""
    where = """(([x, y]) => {
        const { pad, drawn } = slipd.cards.get("left");
        if (!drawn.tactile) return null; // a pad without an image has another scale
        pad.scrollIntoView({ block: "center" });
        const { left, top } = pad.getBoundingClientRect();
        const { scale, origin } = drawn.pad;
        return [left + origin[0] + scale * x, top + origin[1] - scale * y];
    })"""
    at = browser.until(f"{where}({list(place_m)})") if place_m else []
    browser.do(lambda page: getattr(page.mouse, action)(*at))


def keys(browser: Browser, *names: str) -> None:
    """Press keys one after the other."""
    browser.do(lambda page: [page.keyboard.press(name) for name in names])


def send_text(browser: Browser, text: str) -> None:
    """Type a text into the field of the guide, and send it by Enter."""
    browser.do(lambda page: page.fill("#typed-text", text))
    browser.do(lambda page: page.press("#typed-text", "Enter"))


def set_slider(browser: Browser, name: str, value: float) -> None:
    browser.do(lambda page: page.locator(f".hand input[name={name}]").fill(str(value)))
