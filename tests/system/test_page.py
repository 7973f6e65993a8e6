"""The live view in a real browser, against a daemon on the virtual gripper."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from browser import MISSING, Browser
from pushed_sensors import HELD, PADS, held
from rig_parts import wait_for
from viewed_rig import ViewedRig

from slipd_client.messages.names import REASONS

pytestmark = [pytest.mark.process, pytest.mark.skipif(bool(MISSING), reason=MISSING), pytest.mark.timeout(180)]

CARD = "slipd.cards.get('left')"

Parts = tuple[ViewedRig, Browser]


SLIDING = {"left": held(PADS["left"], (0.4, 4.7), 0.008), "right": HELD["right"]}


@pytest.fixture(scope="module")
def parts(tmp_path_factory: pytest.TempPathFactory, browser: Browser) -> Iterator[Parts]:
    """A gripped object, and a browser that shows it."""
    with ViewedRig(tmp_path_factory.mktemp("page")) as rig:
        browser.open(rig.url)
        rig.grip(10.0, HELD)
        browser.until(f"{CARD}?.drawn.slip?.pole_m && {CARD}.drawn.pad.circles.length > 0")
        yield rig, browser


FIELDS = {
    "normal_n": ("normal_n", 1, 2),
    "tangential_vector": ("tangential_n", 1, 2),
    "spin_nm": ("spin_nm", 1, 4),
    "friction_ratio": ("friction_ratio", 1, 3),
    "mu": ("mu", 1, 2),
    "required_friction": ("required_friction", 1, 3),
    "centroid_m": ("centroid_m", 1000, 1),
    "tipping_margin_m": ("tipping_margin_m", 1000, 1),
    "utilisation": ("utilisation", 1, 2),
}
"""Fields of the page: the field of the message, the factor of its unit on the page, and the digits shown."""


def test_the_numbers_of_a_finger_are_those_of_the_message(parts: Parts) -> None:
    rig, browser = parts
    page = browser.until(
        f"""(() => {{
            const {{ slip }} = {CARD}.drawn;
            if (!slip) return null;
            const field = (name) => document.querySelector(`[data-field="left.${{name}}"]`).textContent;
            return {{seq: slip.seq, level: document.querySelector(".level").textContent,
                texts: {json.dumps([*FIELDS])}.map(field)}};
        }})()"""
    )
    message = wait_for(lambda: rig.messages.get(("slip.left", page["seq"])))
    assert page["level"] == shown(message["level"])
    for text, (field, factor, digits) in zip(page["texts"], FIELDS.values(), strict=True):
        if message[field] is None:
            assert text == "unknown"
            continue
        numbers = [float(each.replace("−", "-")) for each in re.findall(r"−?\d+(?:\.\d+)?", text)]
        values = np.atleast_1d(message[field]) * factor
        assert numbers[: len(values)] == pytest.approx(values, abs=0.51 * 10**-digits), field


def test_centroid_pole_and_circles_are_drawn_where_the_numbers_say(parts: Parts) -> None:
    """Each loaded taxel has a circle round its centre, as large as its share of the friction limit."""
    rig, browser = parts
    drawn = browser.until(
        f"""(() => {{
            const {{ slip, tactile, pad }} = {CARD}.drawn;
            if (!slip?.pole_m || !pad.circles.length) return null;
            const canvas = {CARD}.pad;
            const context = canvas.getContext("2d");
            const pixel = ([x, y]) => [...context.getImageData(x * devicePixelRatio, y * devicePixelRatio, 1, 1).data];
            const rings = pad.circles.map(([x, y, radius]) => {{
                const off = [-1.5, -1, -0.5, 0, 0.5, 1, 1.5].map((step) => radius + step);
                return off.flatMap((r) => [pixel([x - r, y]), pixel([x + r, y]), pixel([x, y - r]), pixel([x, y + r])]);
            }});
            const style = getComputedStyle(document.documentElement);
            const colours = Object.fromEntries(["centroid", "pole", "circle"].map(
                (name) => [name, style.getPropertyValue(`--${{name}}`).trim()]));
            return {{ slip: slip.seq, tactile: tactile.seq, ...pad, rings, colours,
                centroidPixel: pixel(pad.centroid), polePixel: pixel(pad.pole.middle) }};
        }})()"""
    )
    slip = wait_for(lambda: rig.messages.get(("slip.left", drawn["slip"])))
    loads = np.array(wait_for(lambda: rig.messages.get(("tactile.left", drawn["tactile"])))["loads_n"])
    assert drawn["centroid"] == pytest.approx(on_canvas(drawn, *slip["centroid_m"]), abs=0.01)
    assert drawn["centroidPixel"][:3] == rgb(drawn["colours"]["centroid"])
    assert drawn["polePixel"][:3] == rgb(drawn["colours"]["pole"])
    assert drawn["pole"]["distance_m"] == pytest.approx(math.dist(slip["pole_m"], slip["centroid_m"]))
    across, along = PADS["left"].positions()
    assert [index for *_, index in drawn["circles"]] == [*np.flatnonzero(loads > 0)]
    for x, y, radius, index in drawn["circles"]:
        assert (x, y) == pytest.approx(on_canvas(drawn, across[index], along[index]), abs=0.01)
        limit_n = slip["mu"] * slip["normal_n"] * loads[index] / loads.sum()
        assert radius * drawn["newtonsPerPixel"] == pytest.approx(limit_n)
    ink = rgb(drawn["colours"]["circle"])
    drawn_circles = [any(near(pixel[:3], ink) for pixel in ring) for ring in drawn["rings"]]
    assert sum(drawn_circles) >= 0.8 * len(drawn_circles), "labels may cover a few"


def on_canvas(drawn: dict[str, Any], x_m: float, y_m: float) -> tuple[float, float]:
    """Where a place of the pad is drawn."""
    return drawn["origin"][0] + drawn["scale"] * x_m, drawn["origin"][1] - drawn["scale"] * y_m


def near(pixel: list[int], ink: list[int]) -> bool:
    return max(abs(a - b) for a, b in zip(pixel, ink, strict=True)) < 80


def rgb(colour: str) -> list[int]:
    return list(bytes.fromhex(colour.removeprefix("#")))


def test_a_refused_request_shows_the_words_of_the_daemon(parts: Parts) -> None:
    _, browser = parts
    browser.press(".tare", "in_contact: ")
    assert browser.value("document.getElementById('reply').dataset.ok") == "false"


def test_a_change_of_the_grip_force_reaches_the_gripper(parts: Parts) -> None:
    rig, browser = parts
    with rig.client() as client:
        before_n = wait_for(lambda: client.status()["gripper"]["force_command_n"])
        # a gripper that is emulated on a busy machine may fall silent, which is latched until it is acknowledged
        browser.press("#more", "grip force +1 N: the gripper was sent ", lambda: rig.grip(10.0, HELD))
        wait_for(lambda: client.status()["gripper"]["force_command_n"] > before_n + 0.5)


def test_a_change_of_level_appears_in_the_list_as_it_was_published(parts: Parts) -> None:
    rig, browser = parts
    rig.sensors.contacts = SLIDING
    try:
        texts = browser.until(
            f"""((texts) => texts.some((text) => text.includes({json.dumps(REASONS["translation"])})) && texts)(
                [...document.querySelectorAll(
                    '#change-list li[data-level="warning"], #change-list li[data-level="slipping"]')]
                .map((item) => item.textContent))"""
        )
        browser.until("['WARNING', 'SLIPPING'].includes(document.querySelector('.level').textContent)")
    finally:
        rig.sensors.contacts = HELD

    def published() -> set[str]:
        """The changes of level that were published, as the page words them."""
        changes = rig.heard("warning")
        return {f"{body['finger']}: {shown(body['previous'])} → {shown(body['level'])}" for body in changes}

    for text in texts:
        assert wait_for(lambda text=text: any(change in text for change in published())), text


def test_sensors_that_fall_silent_are_unknown_with_the_reason(parts: Parts) -> None:
    rig, browser = parts
    rig.sensors.silent = True
    try:
        browser.until("document.querySelector('.level').textContent === 'UNKNOWN'")
        browser.until("document.querySelector('.why').textContent.startsWith('stale: ')")
        browser.until("document.querySelector('[data-stream=\"left.wrench\"]').dataset.health === 'STALE'")
    finally:
        rig.sensors.silent = False


def shown(level: str) -> str:
    return level.upper().replace("_", " ")


def test_a_daemon_that_ends_is_stale_and_one_that_returns_is_live(parts: Parts) -> None:
    rig, browser = parts
    state = "document.getElementById('connection').dataset.state"
    browser.until(f"{state} === 'live'")
    rig.daemon.terminate()
    browser.until(
        """[...document.querySelectorAll(".finger .why")].every(
            (why) => why.textContent.startsWith("stale: no verdict for "))"""
    )
    browser.until(f"{state} === 'stale' && slipd.state.staleFingers().length === 2")
    cards = browser.value(
        """[...document.querySelectorAll(".finger")].map((card) => [card.querySelector(".level").textContent,
            card.querySelector('[data-field$=".normal_n"]').textContent])"""
    )
    assert cards == [["UNKNOWN", "unknown"]] * 2
    rig.daemon.wait()
    with rig.start_daemon():
        browser.until(f"{state} === 'live'")


def test_a_message_that_reached_the_server_long_ago_is_stale_in_a_browser_that_opens_now(parts: Parts) -> None:
    _, browser = parts
    ages = browser.value(
        """import("/state.js").then(({ State }) => [0.1, 0.8].map((age) => {
            const now = performance.now();
            performance.now = () => now; // of this object alone, which hides the clock of the page
            try {
                const state = new State(false);
                const topics = { "slip.left": { boot: "b", seq: 1, t_ns: 1e9 } };
                state.apply({ topics, ages: { "slip.left": age }, changes: [] });
                return [state.age("slip.left"), state.stale("slip.left")];
            } finally {
                delete performance.now;
            }
        }))"""
    )
    assert [stale for _, stale in ages] == [False, True]
    assert ages[1][0] == pytest.approx(0.8)


def test_an_unknown_grip_force_is_hatched_and_not_an_empty_bar(parts: Parts) -> None:
    _, browser = parts
    pixels = """((now) => {
        const canvas = document.createElement("canvas");
        canvas.style.cssText = "width: 400px; height: 64px; position: absolute; left: 0; top: 0";
        document.body.append(canvas);
        return import("/gauges.js").then(({ drawGrip }) => {
            const drawn = drawGrip(canvas, now, 5, 40);
            const row = [...canvas.getContext("2d").getImageData(0, canvas.height / 2, canvas.width, 1).data];
            canvas.remove();
            const colours = new Set(row.flatMap((_, at) => (at % 4 ? [] : [row.slice(at, at + 3).join(",")])));
            return { now: drawn.now, colours: [...colours] };
        });
    })"""
    unknown = ",".join(
        map(str, rgb(browser.value("getComputedStyle(document.documentElement).getPropertyValue('--unknown')")))
    )
    assert unknown in browser.value(f"{pixels}(null)")["colours"]
    assert browser.value(f"{pixels}(null)")["now"] is None
    assert unknown not in browser.value(f"{pixels}(0)")["colours"]


def test_the_page_loads_nothing_from_elsewhere(parts: Parts) -> None:
    rig, browser = parts
    assert browser.hosts == {rig.url.split("/")[2]}
