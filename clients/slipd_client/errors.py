"""Every exception that the client raises on purpose.

    SlipdClientError
    ├── ClientError           something went wrong at run time
    │   ├── Silence             no message for longer than the caller allows
    │   ├── NoAnswer            no reply in time; it is not known whether the request was carried out
    │   ├── RequestRefused      the daemon answered that it did not carry out the request
    │   │   └── TareGivenUp       the daemon began the tare and gave it up
    │   ├── LeaseLost           the lease of this block has ended; nothing was sent
    │   ├── LeaseInUse          another thread or task holds the lease of this client; nothing was sent
    │   ├── FrictionNotMeasured the friction of a finger could not be measured
    │   └── ConnectionClosed    the client was closed
    ├── CallError             an argument of a call is wrong: an endpoint, a duration of 0 s (also a ValueError)
    ├── MessageError          bytes or values that do not form an acceptable message (also a ValueError)
    └── KeyFileError          a key file cannot be used (also a ValueError)

The text of an error names the subject, the rule and what was found.
"""

from __future__ import annotations

import importlib.util
import math
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from slipd_client.messages.names import ErrorCode


class SlipdClientError(Exception):
    """Base of every exception of this library."""


class ClientError(SlipdClientError):
    """Something went wrong at run time: the daemon, the connection or the lease."""


class Silence(ClientError):  # noqa: N818 - it names what happened
    """No message arrived for longer than the caller allows: the last one no longer describes the present."""


class NoAnswer(ClientError):  # noqa: N818 - it names what happened
    """No reply arrived in time. The request may have been carried out, unless the text says otherwise."""


class LeaseLost(ClientError):  # noqa: N818 - it names what happened
    """The lease has ended, and another client may move the gripper; the request was not sent."""


class LeaseInUse(ClientError, ValueError):  # noqa: N818 - it names what happened
    """Another thread or task holds the lease of this client; nothing was sent.

    Raised where a second lease is asked for on one client, and where a request that needs the lease comes from a
    thread or task that does not hold it. Give each thread or task that moves the gripper a client of its own.
    """


class ConnectionClosed(ClientError):  # noqa: N818 - it names what happened
    """The client was closed; nothing more is sent or received."""


class FrictionNotMeasured(ClientError):  # noqa: N818 - it names what happened
    """The friction of a finger could not be measured; the text says why."""


class _CodedError(SlipdClientError):
    """A fault with a code, what would be right, and the field at fault ("" where no single one is)."""

    def __init__(self, code: str, message: str, field: str = "") -> None:
        self.code, self.message, self.field = code, message, field
        super().__init__(fault_text(code, message, field))


class RequestRefused(_CodedError, ClientError):  # noqa: N818 - it names what happened
    """The daemon answered, and did not carry out the request.

    Attributes:
        code: One of ``slipd_client.messages.ERROR_CODES``, or one that a newer daemon knows.
        message: What was wrong and what would be right.
        field: The field of the request at fault; "" where no single field is.
    """


class TareGivenUp(RequestRefused):
    """The daemon began the tare and gave it up; the tare in use stays.

    Attributes:
        reason: One of ``slipd_client.messages.TARE_REASONS``, or one that a newer daemon knows; "" from a daemon that
            does not send it.
        code: "in_contact" where the finger was touched, "not_ready" for every other reason.
    """

    def __init__(self, reason: str, message: str) -> None:
        self.reason = reason
        super().__init__("in_contact" if reason == "contact" else "not_ready", message)


class CallError(SlipdClientError, ValueError):
    """The arguments of a call are wrong; the text names the argument, the rule and the value."""


class MessageError(_CodedError, ValueError):
    """Bytes or values that do not form an acceptable message.

    Attributes:
        code: The kind of fault, as in the ``error`` of a reply.
        message: What is wrong and what would be right.
        field: Dotted path of the field at fault; "" where no single field is.
        number: ``id`` of the request that has the fault; None where it could not be read.
    """

    code: ErrorCode
    number: str | int | None = None


class KeyFileError(SlipdClientError, ValueError):
    """A key file that cannot be used or created; the text says what would be right."""


def fault_text(code: str, message: str, field: str) -> str:
    """Return a fault in one line for people; the field is named once."""
    named = not field or message.startswith((f"{field} ", f"{field}: "))
    return f"{code}: {message}" if named else f"{code}: {field}: {message}"


def check_seconds(name: str, value: Any, example: float) -> None:
    """Do nothing for a positive, finite time.

    Raises:
        CallError: The value is anything else.
    """
    if not isinstance(value, (int, float)) or not 0 < value < math.inf:
        raise CallError(f"{name} must be a positive time in seconds, e.g. {example:g}, got {value!r:.60}")


def require(module: str, package: str, command: str) -> None:
    """Do nothing where the package of others that a command needs is installed.

    Raises:
        CallError: It is not; the text says how to install it.
    """
    if importlib.util.find_spec(module) is None:
        raise CallError(f"{command} needs the package {package}: pip install {package}")
