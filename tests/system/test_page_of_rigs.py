"""The live view in a real browser: keys, a faulty taxel, a finger without friction coefficient, the demo."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from browser import MISSING, Browser
from pushed_sensors import HELD, PADS
from rig_parts import PATIENCE_S, part, wait_for
from viewed_rig import ViewedRig

from slipd_client.messages.names import REASONS

pytestmark = [pytest.mark.process, pytest.mark.skipif(bool(MISSING), reason=MISSING), pytest.mark.timeout(180)]

Parts = tuple[ViewedRig, Browser]

HOT_TAXEL = 13


def test_the_demo_leads_a_browser_to_its_page(tmp_path: Path, browser: Browser) -> None:
    """The file that the demo opens is followed by a real browser; only its user may read it, and no argument tells."""
    copy, told, opener = tmp_path / "copy.html", tmp_path / "told", tmp_path / "opener"
    opener.write_text(
        f'#!/bin/sh\ncp -p "${{1#file://}}" {copy} && echo "$1" >{told}.new && mv {told}.new {told}\n', encoding="utf-8"
    )
    opener.chmod(0o700)
    with part(tmp_path, "slipd", "demo", "--seconds", "120", DISPLAY=":99", BROWSER=f"{opener} %s") as demo:
        wait_for(told.exists)
        browser.do(lambda page: (page.goto(copy.as_uri()), page.wait_for_url("http://127.0.0.1:*/**")))
        browser.until("window.slipd?.cards.size === 2")
        rows = browser.until(
            """((rows) => rows.length > 0 && rows.map((row) => row.dataset.stream))(
                [...document.querySelectorAll("#stream-rows tr")])"""
        )
        assert sorted(rows) == ["gripper", "left.pad", "left.wrench", "right.pad", "right.wrench"]
        browser.leave()  # before its server ends
        demo.terminate()
        out, _ = demo.communicate(timeout=PATIENCE_S)
    (url,) = re.findall(r"^view: (http://127\.0\.0\.1:\d+/#\S{20,})$", out, re.MULTILINE)
    assert f'content="0; url={url}"' in copy.read_text()
    assert copy.stat().st_mode & 0o077 == 0
    opened = told.read_text().strip()
    assert url.partition("#")[2] not in opened, "every user can read the arguments of a process"
    assert not Path(opened.removeprefix("file://")).exists(), "it is removed with the demo"


@pytest.fixture(scope="module")
def parts(tmp_path_factory: pytest.TempPathFactory, browser: Browser) -> Iterator[Parts]:
    """Open fingers of a daemon across TCP: the left pad has a faulty taxel, the right finger lacks a coefficient."""
    folder = tmp_path_factory.mktemp("rigs")
    with ViewedRig(folder, without_mu="right", keyed=True) as rig:
        rig.sensors.hot = ("left", HOT_TAXEL)
        browser.open(rig.url)
        yield rig, browser


def test_a_client_with_keys_shows_a_daemon_across_tcp_and_may_request(parts: Parts) -> None:
    _, browser = parts
    browser.until("document.getElementById('connection').dataset.state === 'live'")
    assert browser.value("document.getElementById('facts').textContent").startswith("tcp://127.0.0.1:")
    browser.press('[data-finger="right"] .tare', "right: zero taken of wrench")


def test_a_key_that_may_only_read_shows_why_no_button_works(parts: Parts) -> None:
    rig, browser = parts
    with rig.view("reader") as url:
        browser.open(url)
        browser.until(
            "document.getElementById('permission').textContent.startsWith('requests are not accepted: read_only')"
        )
        browser.until(
            "slipd.cards.size === 2 && [...document.querySelectorAll('.tare')].every((each) => each.disabled)"
        )
        browser.until("document.getElementById('connection').dataset.state === 'live'")
    browser.open(rig.url)


def test_a_masked_taxel_is_crossed_out_and_counted(parts: Parts) -> None:
    rig, browser = parts
    crossed = browser.until(
        """(() => {
            const card = slipd.cards.get("left");
            if (!card?.caption.textContent.includes("1 taxel is not used (×)")) return null;
            const context = card.pad.getContext("2d");
            const middle = ([x, y]) => [...context.getImageData(x * devicePixelRatio, y * devicePixelRatio, 1, 1).data];
            const ink = getComputedStyle(document.documentElement).getPropertyValue("--masked").trim();
            return { ink, middles: card.drawn.pad.taxels.map(middle) };
        })()"""
    )
    wait_for(lambda: [HOT_TAXEL] in masked(rig))
    ink = bytes.fromhex(crossed["ink"].removeprefix("#"))
    marked = [max(abs(a - b) for a, b in zip(pixel, ink, strict=False)) < 60 for pixel in crossed["middles"]]
    assert [index for index, found in enumerate(marked) if found] == [HOT_TAXEL]
    assert len(marked) == PADS["left"].taxels


def masked(rig: ViewedRig) -> list[list[int]]:
    """The masked taxels of the left pad, as each status so far names them."""
    return [body["streams"]["left.pad"]["masked"] for body in rig.heard("status")]


def test_a_finger_without_a_friction_coefficient_is_unknown_and_shows_what_is_known(parts: Parts) -> None:
    rig, browser = parts
    rig.sensors.hot = None
    rig.grip(10.0, HELD)
    page: dict[str, Any] = browser.until(
        """(() => {
            const card = slipd.cards.get("right");
            const slip = card?.drawn.slip;
            if (!(slip?.required_friction > 0)) return null;
            const text = (field) => document.querySelector(`[data-field="${field}"]`).textContent;
            return { seq: slip.seq, level: card.level.textContent, why: card.why.textContent,
                right: ["mu", "utilisation", "required_friction"].map((field) => text(`right.${field}`)),
                leftMu: text("left.mu"), circles: card.drawn.pad.circles.length, caption: card.caption.textContent,
                bar: card.drawn.bar.value };
        })()"""
    )
    message = wait_for(lambda: rig.messages.get(("slip.right", page["seq"])))
    assert (message["mu"], message["mu_source"], message["utilisation"]) == (None, "none", None)
    assert page["level"] == message["level"].upper().replace("_", " ")
    assert REASONS[message["reasons"][0]] in page["why"]
    assert float(page["right"][2]) == pytest.approx(message["required_friction"], abs=0.02)
    assert (*page["right"][:2], page["circles"], page["bar"]) == ("unknown", "unknown", 0, None)
    assert "no friction circles" in page["caption"]
    assert page["leftMu"].startswith("0.50 (config")
