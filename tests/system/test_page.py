"""The live view in a real browser, against a daemon on the virtual gripper."""

from __future__ import annotations

import contextlib
import json
import re
import threading
from collections.abc import Iterator
from typing import Any

import pytest
from browser import MISSING, Browser
from pushed_sensors import HELD, PADS, held
from rig_parts import wait_for
from viewed_rig import ViewedRig

from slipd_client.errors import ClientError
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


def number(text: str) -> float:
    """The first number of a text of the page."""
    found = re.search(r"−?\d+(\.\d+)?", text)
    assert found is not None, text
    return float(found[0].replace("−", "-"))


def test_the_numbers_of_a_finger_are_those_of_the_message(parts: Parts) -> None:
    rig, browser = parts
    page = browser.until(
        f"""(() => {{
            const {{ slip }} = {CARD}.drawn;
            if (!slip) return null;
            const field = (name) => document.querySelector(`[data-field="left.${{name}}"]`).textContent;
            const names = ["normal_n", "tangential_vector", "spin_nm", "friction_ratio", "mu", "required_friction",
                "centroid_m", "tipping_margin_m", "bounds", "utilisation"];
            return {{seq: slip.seq, level: document.querySelector(".level").textContent,
                texts: Object.fromEntries(names.map((name) => [name, field(name)]))}};
        }})()"""
    )
    message = wait_for(lambda: rig.messages.get(("slip.left", page["seq"])))
    texts = page["texts"]
    assert page["level"] == shown(message["level"])
    for field, factor, digits in (
        ("normal_n", 1, 2),
        ("spin_nm", 1, 4),
        ("friction_ratio", 1, 3),
        ("mu", 1, 2),
        ("required_friction", 1, 3),
        ("tipping_margin_m", 1000, 1),
    ):
        assert_shown(texts[field], message[field], factor, digits)
    for name, field, factor, digits in (
        ("tangential_vector", "tangential_n", 1, 2),
        ("centroid_m", "centroid_m", 1000, 1),
    ):
        for text, value in zip(texts[name].split(","), message[field], strict=True):
            assert_shown(text, value, factor, digits)
    assert_shown(texts["utilisation"], message["utilisation"], 1, 2)


def assert_shown(text: str, value: float | None, factor: float, digits: int) -> None:
    if value is None:
        assert text == "unknown"
    else:
        assert number(text) == pytest.approx(value * factor, abs=0.51 * 10**-digits)


def test_centroid_pole_and_circles_are_drawn_where_the_numbers_say(parts: Parts) -> None:
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
    tactile = wait_for(lambda: rig.messages.get(("tactile.left", drawn["tactile"])))
    scale, (left, top) = drawn["scale"], drawn["origin"]
    x_m, y_m = slip["centroid_m"]
    assert drawn["centroid"] == pytest.approx([left + scale * x_m, top - scale * y_m], abs=0.01)
    assert drawn["centroidPixel"][:3] == rgb(drawn["colours"]["centroid"])
    assert drawn["polePixel"][:3] == rgb(drawn["colours"]["pole"])
    assert drawn["pole"]["distance_m"] == pytest.approx(
        sum((a - b) ** 2 for a, b in zip(slip["pole_m"], slip["centroid_m"], strict=True)) ** 0.5
    )
    assert_circles(drawn, slip, tactile)


def assert_circles(drawn: dict[str, Any], slip: dict[str, Any], tactile: dict[str, Any]) -> None:
    """Each loaded taxel has a circle round its centre, as large as its share of the friction limit."""
    loads = tactile["loads_n"]
    across, along = PADS["left"].positions()
    assert [index for *_, index in drawn["circles"]] == [index for index, load in enumerate(loads) if load > 0]
    for x, y, radius, index in drawn["circles"]:
        left, top = drawn["origin"]
        where = (left + drawn["scale"] * across[index], top - drawn["scale"] * along[index])
        assert (x, y) == pytest.approx(where, abs=0.01)
        limit_n = slip["mu"] * slip["normal_n"] * loads[index] / sum(loads)
        assert radius * drawn["newtonsPerPixel"] == pytest.approx(limit_n)
    ink = rgb(drawn["colours"]["circle"])
    drawn_circles = [any(near(pixel[:3], ink) for pixel in ring) for ring in drawn["rings"]]
    assert sum(drawn_circles) >= 0.8 * len(drawn_circles), "labels may cover a few"


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
        browser.press("#more", "grip force +1 N: the gripper was sent ")
        wait_for(lambda: client.status()["gripper"]["force_command_n"] > before_n + 0.5)


def test_another_client_that_holds_the_lease_is_named_as_the_reason(parts: Parts) -> None:
    """The lease is held by a client that renews it in time: the refusal comes from the daemon."""
    rig, browser = parts
    ended = threading.Event()

    def hold() -> None:
        with rig.client() as client:
            while not ended.is_set():
                with contextlib.suppress(ClientError), client.lease() as lease:
                    while not ended.is_set():
                        lease.wait(0.05)

    holder = threading.Thread(target=hold)
    holder.start()
    try:
        browser.press("#more", "lease_held: another client holds the lease")
    finally:
        ended.set()
        holder.join()


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
    for text in texts:
        assert wait_for(lambda text=text: any(change in text for change in published(rig))), text


def published(rig: ViewedRig) -> set[str]:
    """The changes of level that were published, as the page words them."""
    return {f"{body['finger']}: {shown(body['previous'])} → {shown(body['level'])}" for body in rig.heard("warning")}


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
        "[...document.querySelectorAll('.finger .why')].every((why) => why.textContent.startsWith('stale: no verdict'))"
    )
    browser.until(f"{state} === 'stale' && slipd.state.staleFingers().length === 2")
    cards = browser.value(
        """[...document.querySelectorAll(".finger")].map((card) => [card.querySelector(".level").textContent,
            card.querySelector(".why").textContent, card.querySelector('[data-field$=".normal_n"]').textContent])"""
    )
    assert [level for level, _, _ in cards] == ["UNKNOWN", "UNKNOWN"]
    assert all(why.startswith("stale: no verdict for ") and normal == "unknown" for _, why, normal in cards)
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


def test_the_page_loads_nothing_from_elsewhere_and_its_scripts_report_no_error(parts: Parts) -> None:
    rig, browser = parts
    assert browser.problems == []
    assert browser.hosts == {rig.url.split("/")[2]}
