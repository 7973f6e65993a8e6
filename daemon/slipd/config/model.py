"""A whole config: the tables that a file may hold."""

from __future__ import annotations

import hashlib

from pydantic import Field, PrivateAttr

from slipd.config.bus_model import Bus, Requests
from slipd.config.finger_model import Finger
from slipd.config.gripper_model import Grasp, Gripper, Reflex
from slipd.config.host_model import Realtime, Restart
from slipd.config.levels_model import Levels, Rates
from slipd.config.recording_model import Recording
from slipd.config.stream_model import Stream
from slipd.config.value_bounds import StrictModel


class Config(StrictModel):
    """A whole config file."""

    bus: Bus = Bus()
    requests: Requests = Requests()
    levels: Levels = Levels()
    rates: Rates = Rates()
    finger: dict[str, Finger] = Field(min_length=1)
    gripper: Gripper | None = None
    grasp: Grasp | None = None
    reflex: Reflex = Reflex()
    recording: Recording = Recording()
    realtime: Realtime = Realtime()
    restart: Restart = Restart()
    _text: str = PrivateAttr(default="")

    @property
    def text(self) -> str:
        """The file as it was read."""
        return self._text

    def with_text(self, text: str) -> Config:
        """Store the text that this config was parsed from."""
        self._text = text
        return self

    @property
    def config_id(self) -> str:
        """Identifies the config in messages: the first 12 hexadecimal digits of the SHA-256 of its text."""
        return hashlib.sha256(self.text.encode()).hexdigest()[:12]

    def streams(self) -> dict[str, Stream]:
        """Return all streams by name: ``left.wrench``, ``left.pad``, ``gripper``, ``object``."""
        found: dict[str, Stream] = {}
        for name, finger in self.finger.items():
            for kind, stream in (("wrench", finger.wrench), ("pad", finger.pad)):
                if stream is not None:
                    found[f"{name}.{kind}"] = stream
        if self.gripper is not None:
            found["gripper"] = self.gripper
        if self.grasp is not None and self.grasp.object is not None:
            found["object"] = self.grasp.object
        return found
