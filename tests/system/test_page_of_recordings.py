"""The page of recordings in a real browser: time line, and what is shown of a rig that lacks this or that."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from altered_recordings import lossy
from browser import MISSING, Browser
from replays import RECORDINGS
from rig_parts import first_line, part

from slipd.recording.reader import open_recording
from slipd.recording.replay import replay

pytestmark = [pytest.mark.process, pytest.mark.skipif(bool(MISSING), reason=MISSING)]


@contextmanager
def served(recording: Path) -> Iterator[str]:
    """Serve the page of a recording; yield its address."""
    with part(recording.parent, "slipd", "view", str(recording), "--listen", "127.0.0.1:0") as view:
        yield first_line(view).partition(": ")[2]


@pytest.fixture(scope="module")
def demo_url() -> Iterator[str]:
    with served(RECORDINGS / "demo.mcap") as url:
        yield url


def read(browser: Browser, url: str) -> None:
    """Open the page of a recording, and wait until it has read all of it."""
    browser.open(url)
    browser.until("slipd.source.ended && slipd.state.fingers().length > 0")


def played(browser: Browser) -> None:
    """Play what is left of the recording as fast as the page can."""
    browser.do(lambda page: page.select_option("#speed", "10"))
    browser.until("document.getElementById('play').textContent === 'Play'")


def sought(browser: Browser) -> float:
    """Wait until the page is where it was told to go, and return the time in the recording, s."""
    browser.until("slipd.source.seeking === null")
    position_s: float = browser.value("slipd.source.position")
    return position_s


def levels(browser: Browser) -> dict[str, str]:
    found: dict[str, str] = browser.value(
        """Object.fromEntries([...document.querySelectorAll(".finger")].map(
            (card) => [card.dataset.finger, card.querySelector(".level").textContent]))"""
    )
    return found


def pause(browser: Browser) -> None:
    """Press "Pause" where the recording has not been played to its end; what "Play" would do then is another test."""
    browser.value("slipd.source.playing && document.getElementById('play').click()")
    browser.until("document.getElementById('play').textContent === 'Play'")


def test_no_level_is_shown_through_lost_entries(browser: Browser, tmp_path: Path) -> None:
    """Before them nothing touched the pads, which is a low bar in the time line; "unknown" is higher."""

    def drawn(t_s: float) -> bool:
        pixel = f"""(() => {{
            const canvas = document.getElementById("levels");
            const at = [canvas.width * {t_s} / slipd.source.seconds, canvas.height * (0.5 - 0.3 / 2)].map(Math.round);
            return canvas.getContext("2d").getImageData(...at, 1, 1).data[3];
        }})()"""
        return bool(browser.value(pixel))

    with served(lossy(RECORDINGS / "demo.mcap", tmp_path)) as url:
        read(browser, url)
        pause(browser)
        browser.do(lambda page: page.fill("#position", "1.9"))
        browser.until("slipd.source.position === 1.9 && slipd.source.seeking === null")
        browser.until("[...document.querySelectorAll('.level')].every((level) => level.textContent === 'UNKNOWN')")
        assert [drawn(t_s) for t_s in (0.9, 1.1, 1.5, 1.85)] == [False, True, True, True]


def test_the_time_line_leads_from_warning_to_warning(browser: Browser, demo_url: str) -> None:
    messages = list(replay(open_recording(RECORDINGS / "demo.mcap")))
    begin_ns = messages[0][1]["t_ns"]
    changes = [(body, (body["t_ns"] - begin_ns) * 1e-9) for topic, body in messages if topic == "warning"]
    alarms = [each for each in changes if each[0]["rising"] and each[0]["level"] in ("warning", "slipping")]
    first, first_s = alarms[0]
    later_s = [t_s for _, t_s in alarms if t_s > first_s + 0.5]
    read(browser, demo_url)
    pause(browser)
    browser.do(lambda page: page.fill("#position", "0"))
    browser.until("slipd.source.position === 0 && slipd.source.seeking === null")
    browser.click("#next")
    browser.until("slipd.source.position > 0")
    assert sought(browser) == pytest.approx(first_s, abs=0.1)
    browser.drawn()
    assert levels(browser)[first["finger"]] == "WARNING"
    assert not browser.value("slipd.state.stale('status')")
    for _ in alarms:
        browser.click("#next")
        sought(browser)
    assert sought(browser) == pytest.approx(later_s[-1], abs=0.1)
    browser.click("#previous")
    assert sought(browser) < later_s[0]
    browser.click("#play")
    played(browser)
    assert sought(browser) == pytest.approx(browser.value("slipd.source.seconds"))


ODD = """([part, more]) => {
    const [finger] = slipd.state.fingers();
    const slip = slipd.state.last(`slip.${finger}`);
    const body = { ...slip, seq: slip.seq + 1000, ...more };
    slipd.source.handlers.onFrame({ now_ns: slip.t_ns, topics: { [`${part}.${finger}`]: body }, changes: [] });
}"""
TAXEL = {"rows": 1, "cols": 1, "pitch_m": 0.001, "rows_along": "+y", "cols_along": "+x", "loads_n": 5}
"""An image whose loads are no list."""


def test_one_finger_is_shown_as_far_as_it_is_known_and_what_cannot_be_drawn_is_never_shown_as_live(
    browser: Browser,
) -> None:
    last = dict(replay(open_recording(RECORDINGS / "bota.mcap")))
    (topic,) = (topic for topic in last if topic.startswith("slip."))
    with served(RECORDINGS / "bota.mcap") as url:
        read(browser, url)
        played(browser)
        browser.drawn()
        texts = browser.value(
            """Object.fromEntries([...document.querySelectorAll("[data-field]")].map(
                (field) => [field.dataset.field.split(".")[1], field.textContent]))"""
        )
        assert len(levels(browser)) == 1
        assert browser.value("document.getElementById('grasp').hidden") is True
        assert "no image of the pad" in browser.value("document.querySelector('figcaption').textContent")
        unknown = {field for field, value in last[topic].items() if value is None} & texts.keys()
        assert {"pole_m", "tipping_margin_m", "required_friction"} <= unknown
        assert {field: texts[field] for field in unknown} == dict.fromkeys(unknown, "unknown")
        odd = ["slip", {"level": "stable", "reasons": ["constructor"]}]
        browser.do(lambda page: page.evaluate(ODD, odd))
        browser.until("document.querySelector('.why').textContent.startsWith('constructor')")
        assert set(levels(browser).values()) == {"STABLE"}
        assert browser.problems == []
        browser.do(lambda page: page.evaluate(ODD, ["tactile", TAXEL]))
        browser.until("document.getElementById('connection').dataset.state === 'stale'")
        assert set(levels(browser).values()) == {"UNKNOWN"}
        browser.problems.clear()


def test_a_fetch_that_fails_is_repeated_and_the_page_recovers(browser: Browser, demo_url: str) -> None:
    fails = True
    browser.do(lambda page: page.route("**/data/block/4", lambda way: way.abort() if fails else way.continue_()))
    browser.open(demo_url)
    browser.until("document.getElementById('connection').dataset.state === 'stale'")
    fails = False
    browser.until("document.getElementById('connection').dataset.state === 'recording'")
    browser.until("slipd.source.position > 4 && slipd.state.fresh('slip.left') !== null")
    browser.do(lambda page: page.unroute("**/data/block/4"))
    browser.problems.clear()  # the failed requests
