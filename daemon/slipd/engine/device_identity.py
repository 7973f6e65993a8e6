"""Identity of the device behind a link: whether it is still the right one."""

from __future__ import annotations

from typing import NamedTuple

from slipd.devices import Session


class Identity(NamedTuple):
    """What is known of the device behind a link.

    Attributes:
        reported: Identity that it reports; "" if it did not yet, or never does.
        opened: What was opened last, e.g. a path or an address; "" before.
    """

    reported: str
    opened: str


class DeviceIdentity:
    """What was opened and which device answered, compared with the config and with the run so far.

    Tare, calibration and mounting belong to one device, so that readings of another one must not be used.

    Args:
        wanted: Identity that the config names, of the device or of what is opened; "" for any.

    Attributes:
        opened: What was opened last, e.g. a path or an address; "" before.
        first: First identity that a device reported in this run; "" before.
        mismatch: Why readings must not be used; "" where they may.
    """

    def __init__(self, wanted: str) -> None:
        self._wanted = wanted
        self._first_opened = ""
        self.opened = self.first = self.mismatch = ""

    def open(self, opened: str) -> bool:
        """Note what was opened; return whether the link was open before in this run."""
        reopened = bool(self._first_opened)
        self._first_opened = self._first_opened or opened
        self.opened = opened
        return reopened

    def check(self, session: Session | None) -> None:
        """Compare what was opened, and the identity that the device reports, if any."""
        identity = session.identity if session is not None else ""
        self.first = self.first or identity
        if self._wanted and self._wanted not in (identity, self.opened):
            self.mismatch = (
                f"another device answers: {identity!r}, where hardware_id says {self._wanted!r}"
                if identity
                else f"waits for the device to identify itself as {self._wanted!r}"
            )
        elif not identity and self.first and session is not None and session.state != "running":
            self.mismatch = "waits for the device to identify itself: another device may be connected now"
        elif identity != self.first and identity:
            self.mismatch = f"another device answers: {identity!r}, where {self.first!r} was; restart slipd"
        elif self.opened != self._first_opened:
            self.mismatch = f"another port answers: {self.opened!r}, where {self._first_opened!r} was"
        else:
            self.mismatch = ""
