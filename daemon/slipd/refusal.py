"""Why a request is not carried out; a leaf, so that every room can refuse."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Refusal:
    """Why a request is not carried out.

    Attributes:
        code: Error code of the message API.
        message: What is wrong and what would be right.
        field: Field of the request; "" where no field is at fault.
    """

    code: str
    message: str
    field: str = ""
