"""``slipd view``: shows a recording in a browser, on the page of the live view."""

from __future__ import annotations

import asyncio
import threading
from http import HTTPStatus
from pathlib import Path

from websockets.http11 import Response

from slipd.compile_kernels import compile_kernels, interruptible
from slipd.errors import SlipdError
from slipd.recording.event_gaps import EventGaps
from slipd.recording.reader import Recording, open_recording
from slipd.recording.recorded_blocks import RecordedBlocks
from slipd.recording.replay import replay
from slipd_client.arguments import ListenAddress
from slipd_client.errors import CallError
from slipd_client.page.page_server import PageServer, Site, answer, json_answer


def view_recording(path: Path, address: ListenAddress) -> None:
    """Serve the page of a recording until Ctrl-C, and print its address.

    The recording is replayed beside that; what is replayed so far can be shown.

    Raises:
        RecordingError: The file cannot be read.
        ConfigError: The recorded config has faults for this version of slipd.
        SlipdError: The port cannot be opened.
    """
    recording = open_recording(path)
    with interruptible():
        view = RecordingView(recording)
        compile_kernels()
    site = Site({"live": False, "source": str(path), "buttons": False})
    try:
        asyncio.run(_serve(PageServer(address, site, on_data=view.answer), view))
    except CallError as error:
        raise SlipdError(str(error)) from error


async def _serve(server: PageServer, view: RecordingView) -> None:
    async with server.serving() as url:
        print(f"view: {url}", flush=True)
        view.start()
        await asyncio.Event().wait()


class RecordingView:
    """Replays a recording in a thread, and answers the page's requests for it."""

    def __init__(self, recording: Recording) -> None:
        self.blocks = RecordedBlocks()
        self._recording = recording
        self._gaps = EventGaps()
        self._messages = replay(recording, on_event=self._gaps.add)
        self._failure = ""

    def start(self) -> None:
        """Begin to replay; the thread ends with the program."""
        threading.Thread(target=self.replay, name="replay", daemon=True).start()

    def replay(self) -> None:
        """Replay the whole recording."""
        try:
            self.blocks.add_all(self._messages)
        except Exception as error:
            self._failure = f"the replay ended early: {error}"
            self.blocks.end()
            raise

    def answer(self, path: str) -> Response | None:
        """Answer ``/data/recording/N``, what there is and the changes of level from the N-th, or ``/data/block/N``.

        Gaps are begin and end of each time of which nothing is known, CLOCK_MONOTONIC, ns. A block without messages, or
        that is not replayed yet, is null.
        """
        _, _, kind, number = path.split("/") if path.count("/") == 3 else ("", "", "", "")
        if not number.isdecimal():
            return None
        if kind == "recording":
            return json_answer(self._state(int(number)))
        if kind != "block":
            return None
        data = self.blocks.block(int(number))
        return json_answer(None) if data is None else answer(HTTPStatus.OK, data, "application/json", "gzip")

    def _state(self, known: int) -> dict[str, object]:
        blocks = self.blocks
        ended = blocks.ended
        return {
            "begin_ns": blocks.begin_ns,
            "seconds": blocks.seconds,
            "ended": ended,
            "changes": blocks.changes[known:],
            "gaps": [[round(gap.begin_s * 1e9), round(gap.end_s * 1e9)] for gap in self._gaps.found],
            "fault": self._fault() if ended else "",
        }

    def _fault(self) -> str:
        """Return why what is shown may not be the whole recording; "" where it is."""
        recording = self._recording
        if self._failure or recording.complete:
            return self._failure
        return recording.fault or (f"{recording.lost} entries are missing" if recording.lost else "the end is missing")
