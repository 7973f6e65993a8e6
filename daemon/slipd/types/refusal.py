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


class RefusalError(Exception):
    """Ends the handling of a request that is refused."""

    def __init__(self, refusal: Refusal) -> None:
        super().__init__(refusal.message)
        self.refusal = refusal


def require(refusal: Refusal | None) -> None:
    """Go on unless there is a refusal.

    Raises:
        RefusalError: There is one.
    """
    if refusal is not None:
        raise RefusalError(refusal)
