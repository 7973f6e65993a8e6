"""`GripClient` under its former name."""

from __future__ import annotations

from slipd_client.grip import GripClient as Requester

__all__ = ["Requester"]
