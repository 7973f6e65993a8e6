"""Explains to the person why a request of the guide failed and what to do, without words of the protocol."""

from __future__ import annotations

from slipd_client.errors import ClientError, RequestRefused, TareGivenUp

TOO_BUSY = "the machine was too busy to answer in time: close other programs on it, and try again"
STATUS = "slipctl status says what is wrong"

LATE_CODES = frozenset({"deadline_passed", "deadline_too_far", "busy", "repeated_id"})
"""Codes of refusals on a machine that is too busy."""

INSTEAD = {
    "wrong_boot": "the daemon was restarted meanwhile: try again",
    "read_only": "the key may only read: name a key that the daemon lists under requesters, with --key",
    "no_lease": f"the right to move the gripper ended before the request arrived; {TOO_BUSY}",
    "lease_held": "another program controls the gripper: end that program, or wait until it lets go",
}
"""Text that replaces the message of a refusal, by its code."""

BESIDE = {
    "in_contact": "take away whatever touches the finger",
    "not_ready": STATUS,
    "no_gripper": STATUS,
    "gripper_fault": "look at the gripper; slipctl grip activate clears the fault of most",
    "not_active": "slipctl grip activate",
}
"""What to do, appended to the message of a refusal, by its code."""

TARES = {
    "contact": "something touched the finger: touch nothing, and leave it free",
    "pulled": "the finger was pulled at: is a cable taut, or the sign of the sensor wrong?",
    "moved": "the readings moved: hold the gripper still, away from machines that shake",
    "turned": "the finger was turned: hold the gripper still",
    "silent": f"the sensor sent nothing for half a second: is the machine busy, or a cable loose? {STATUS}",
    "ended": f"the sensor was cut off: are its cable and its power in place? {STATUS}",
    "undone": "another program took the zero back: end that program",
}
"""Cause and remedy of a tare that was given up, by its reason."""


def reason_of(error: ClientError) -> str:
    """Return why a request was not carried out, and what to do."""
    if isinstance(error, TareGivenUp) and error.reason in TARES:
        return TARES[error.reason]
    if not isinstance(error, RequestRefused):
        return str(error)
    if error.code in LATE_CODES:
        return TOO_BUSY
    if error.code in INSTEAD:
        return INSTEAD[error.code]
    return f"{error.message}; {BESIDE[error.code]}" if error.code in BESIDE else error.message
