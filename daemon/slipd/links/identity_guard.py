"""Whether the right device is on a link: the one that the config names, or that was there before in this run."""

from __future__ import annotations

from slipd.devices import Session


class IdentityGuard:
    """What was opened and which device answered, compared with the config and with the run so far.

    Tare, calibration and mounting belong to one device, so that readings of another one must not be used.

    Args:
        wanted: Identity that the config names, of the device or of what is opened; "" for any.
        session: The conversation in which the device reports its identity; None for a device that sends unasked.

    Attributes:
        opened: What was opened last, e.g. a path or an address; "" before.
        first: First identity that a device reported in this run; "" before.
        mismatch: Why readings must not be used; "" where they may.
    """

    def __init__(self, wanted: str, session: Session | None) -> None:
        self._wanted, self._session = wanted, session
        self._first_opened = ""
        self.opened = self.first = self.mismatch = ""

    def open(self, opened: str) -> bool:
        """Note what was opened; return whether the link was open before in this run."""
        reopened = bool(self._first_opened)
        self._first_opened = self._first_opened or opened
        self.opened = opened
        return reopened

    @property
    def reported(self) -> str:
        """Identity that the device reports; "" if it did not yet, or never does."""
        return self._session.identity if self._session is not None else ""

    def check(self) -> None:
        """Compare what was opened, and the identity that the device reports, if any."""
        session, identity = self._session, self.reported
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
