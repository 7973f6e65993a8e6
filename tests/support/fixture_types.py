"""What the fixtures of the unit tests return: they parse a config text and make single samples."""

from __future__ import annotations

from collections.abc import Callable

from slipd.config import Config
from slipd.types.samples import TactileSample, WrenchSample

Parse = Callable[[str], Config]
Wrench = Callable[..., WrenchSample]
Image = Callable[..., TactileSample]
