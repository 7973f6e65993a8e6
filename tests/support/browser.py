"""A real browser for tests and pictures of the page: headless Chromium, driven from a thread of its own.

    PYTHONPATH=tests/support python -m browser      say whether there is one

The thread is needed because Playwright's blocking interface runs an event loop in the thread that calls it.
"""

from __future__ import annotations

import importlib.util
import os
import shutil
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING, Any, TypeVar
from urllib.parse import urlsplit

from rig_parts import PATIENCE_S

if TYPE_CHECKING:
    from playwright.sync_api import Page

T = TypeVar("T")

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
MISSING = (
    "" if CHROMIUM and importlib.util.find_spec("playwright") else "there is no Chromium (Debian: apt install chromium)"
)
"""Why no browser can be started; "" where one can."""


class Browser:
    """One page in one browser; ``with`` starts it beside what follows, and ends it.

    Attributes:
        problems: Errors and warnings of the page's console, and exceptions of its scripts.
        hosts: Hosts that the page sent requests to.
    """

    def __init__(self, width: int = 1280, height: int = 1000, *, dark: bool = False) -> None:
        self.problems: list[str] = []
        self.hosts: set[str] = set()
        self._options: dict[str, Any] = {
            "viewport": {"width": width, "height": height},
            "color_scheme": "dark" if dark else "light",
        }
        self._thread = ThreadPoolExecutor(1, "browser")

    def __enter__(self) -> Browser:
        self._started = self._thread.submit(self._start)
        return self

    def __exit__(self, *_: object) -> None:
        if self._started.exception() is None:
            self._thread.submit(self._end).result()
        self._thread.shutdown()

    def do(self, work: Callable[[Page], T]) -> T:
        """Let the thread of the browser do something with the page, and return its result."""
        self._started.result()
        return self._thread.submit(lambda: work(self._page)).result()

    def leave(self) -> None:
        """Check that no script of the page failed, leave it, and forget what was noted of it."""
        problems = self.problems.copy()
        self.do(lambda page: page.goto("about:blank"))
        self.problems.clear()
        self.hosts.clear()
        assert not problems, problems

    def open(self, url: str) -> None:
        """Open the page, and wait until it has started."""
        self.do(lambda page: page.goto(url))
        self.until("window.slipd !== undefined")

    def value(self, script: str) -> Any:
        """Return the value of an expression in the page."""
        return self.do(lambda page: page.evaluate(script))

    def until(self, condition: str) -> Any:
        """Wait until an expression in the page is true, and return its value.

        Playwright's own ``wait_for_function`` would evaluate the text within the page, which its policy forbids.
        """
        until_s = time.monotonic() + PATIENCE_S
        while not (found := self.value(condition)):
            assert time.monotonic() < until_s, f"never true in the page: {condition}"
            time.sleep(0.03)
        return found

    def drawn(self) -> None:
        """Wait until the page has drawn what it received so far: it draws once, in the next frame of the screen."""
        self.do(
            lambda page: page.evaluate(
                "new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))"
            )
        )

    def click(self, selector: str) -> None:
        self.do(lambda page: page.click(selector))

    def press(self, button: str, reply: str, mend: Callable[[], object] | None = None) -> None:
        """Press a button until its reply begins as expected: a busy machine has reasons of its own to refuse.

        Args:
            button: Selector of the button.
            reply: Begin of the expected reply.
            mend: Called after another reply, before the next try.
        """
        until_s = time.monotonic() + PATIENCE_S
        shown = "((text) => text !== '…' && text)(document.getElementById('reply').textContent)"
        while not (found := (self.click(button), self.until(shown))[1]).startswith(reply):
            assert time.monotonic() < until_s, found
            if mend is not None:
                mend()
            time.sleep(0.1)

    def _start(self) -> None:
        from playwright.sync_api import sync_playwright

        # Of this thread alone, and of what it starts: drawing must not make a daemon late that shares the machine.
        os.setpriority(os.PRIO_PROCESS, 0, 10)
        self._playwright = sync_playwright().start()
        self._browser = self._playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        self._page = self._browser.new_page(**self._options)
        self._page.set_default_timeout(PATIENCE_S * 1000)
        self._page.on("request", lambda request: self.hosts.add(urlsplit(request.url).netloc))
        self._page.on("websocket", lambda socket: self.hosts.add(urlsplit(socket.url).netloc))
        self._page.on("pageerror", lambda error: self.problems.append(str(error)))
        self._page.on("console", self._note)

    def _note(self, message: Any) -> None:
        if message.type == "error" or (message.type == "warning" and "willReadFrequently" not in message.text):
            self.problems.append(message.text)

    def _end(self) -> None:
        self._browser.close()
        self._playwright.stop()


if __name__ == "__main__" and MISSING:
    print(f"== the live view was not tested in a browser: {MISSING}")
