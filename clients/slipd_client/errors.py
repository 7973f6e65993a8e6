"""Every exception the client raises on purpose.

    ClientError
    ├── Silence           nothing was heard for longer than the caller allows
    ├── NoAnswer          no reply came in time; whether the request was carried out is not known
    ├── RequestRefused    the daemon answered, and did not do it
    └── LeaseLost         the lease of this block has ended; nothing was sent

A bad call (an endpoint that is none, a time that is no time) raises ValueError.
"""

from __future__ import annotations

from slipd_client.messages import fault_text


class ClientError(Exception):
    """Base of all."""


class Silence(ClientError):  # noqa: N818 - it names what happened
    """Nothing was heard for longer than the caller allows: whatever was heard last says nothing of now."""


class NoAnswer(ClientError):  # noqa: N818 - it names what happened
    """No reply came in time; whether the request was carried out is not known, unless the text says so."""


class LeaseLost(ClientError):  # noqa: N818 - it names what happened
    """The lease has ended, and another client may hold the gripper; the request was not sent."""


class RequestRefused(ClientError):  # noqa: N818 - it names what happened
    """The daemon answered, and did not do it.

    Attributes:
        code: One of ``slipd_client.messages.ERROR_CODES``, or one that a newer daemon knows.
        message: What was wrong and what would be right.
        field: The field of the request at fault; "" where no single field is.
    """

    def __init__(self, code: str, message: str, field: str = "") -> None:
        self.code = code
        self.message = message
        self.field = field
        super().__init__(fault_text(code, message, field))


def is_it_there(endpoint: str) -> str:
    """The question to ask where nobody is heard at an endpoint."""
    across = endpoint.startswith("tcp:")
    return "Is slipd running, and are the keys right?" if across else "Is slipd running?"
