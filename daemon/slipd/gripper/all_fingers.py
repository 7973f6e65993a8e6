"""Contact and trust of all fingers together, for the motion gate and the grip in force."""

from __future__ import annotations

from collections.abc import Mapping

from slipd.finger.finger import Finger


class AllFingers:
    """All fingers of the gripper.

    Args:
        fingers: The fingers by name.
    """

    def __init__(self, fingers: Mapping[str, Finger]) -> None:
        self._fingers = fingers

    def pressed(self) -> bool:
        """Return whether any finger is known to be pressed."""
        return any(finger.presence.is_pressed() for finger in self._fingers.values())

    def pressed_n(self, t_ns: int) -> float | None:
        """Return the larger normal force of a contact, N; None if there is none that is trusted."""
        forces_n = (finger.presence.contact_force_n(t_ns) for finger in self._fingers.values())
        return max((force_n for force_n in forces_n if force_n is not None), default=None)

    def blind(self, t_ns: int) -> tuple[str, ...]:
        """Return the fingers whose sensors are stale or not trusted."""
        return tuple(name for name, finger in self._fingers.items() if not finger.trust.for_raise(t_ns))

    def not_free(self, t_ns: int) -> tuple[str, ...]:
        """Return the fingers that are pressed, or not known to be free."""
        return tuple(
            name
            for name, finger in self._fingers.items()
            if finger.presence.is_pressed() is not False or not finger.trust.at_rest(t_ns)
        )
