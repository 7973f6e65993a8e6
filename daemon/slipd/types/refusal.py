"""Why a request is refused; a leaf module, so that every room can refuse."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Refusal:
    """Why a request is refused.

    Attributes:
        code: Error code of the message API.
        message: The rule, and what was found.
        field: Field of the request at fault; "" if none is.
    """

    code: str
    message: str
    field: str = ""
