"""A thread beside the messages of ``slipctl serve ros2``."""

from __future__ import annotations

import threading


class Background(threading.Thread):
    """A daemon thread that runs until `stop`.

    Args:
        name: What it does.
    """

    def __init__(self, name: str) -> None:
        super().__init__(name=name, daemon=True)
        self._ended = threading.Event()

    def stop(self) -> None:
        """End the thread."""
        self._ended.set()
        self.join()
