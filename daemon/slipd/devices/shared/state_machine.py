"""State machines as tables: for each state, the events that it accepts and the state that follows.

The table defines the machine completely. An event that is not in the row of the present state is refused: the state
stays, and `StateMachine.handle` returns False.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import Enum
from typing import Generic, TypeVar

StateT = TypeVar("StateT", bound=Enum)
EventT = TypeVar("EventT", bound=Enum)


class StateMachine(Generic[StateT, EventT]):
    """A state that changes only as its table allows.

    Args:
        table: For each state, the events that it accepts and the state that follows.
        state: The first state.

    Attributes:
        state: The present state.
    """

    def __init__(self, table: Mapping[StateT, Mapping[EventT, StateT]], state: StateT) -> None:
        self._table = table
        self.state = state

    def accepts(self, event: EventT) -> bool:
        """Return whether the present state accepts an event."""
        return event in self._table[self.state]

    def handle(self, event: EventT) -> bool:
        """Go to the state that follows; return False, and stay, if the present state refuses the event."""
        following = self._table[self.state].get(event)
        if following is None:
            return False
        self.state = following
        return True
