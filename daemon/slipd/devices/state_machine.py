"""State machines as tables: for each state, the events that it takes and the state that follows.

A table defines its machine completely. An event that is not in the row of the present state is refused: the state
stays, and `StateMachine.handle` returns False.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import Enum
from typing import Generic, TypeVar

StateT = TypeVar("StateT", bound=Enum)
EventT = TypeVar("EventT", bound=Enum)


class StateMachine(Generic[StateT, EventT]):
    """A state that changes only by its table.

    Args:
        table: For each state, the events that it takes and the state that follows.
        state: The first state.

    Attributes:
        state: The present state.
    """

    def __init__(self, table: Mapping[StateT, Mapping[EventT, StateT]], state: StateT) -> None:
        self._table = table
        self.state = state

    def takes(self, event: EventT) -> bool:
        """Return whether the present state takes an event."""
        return event in self._table[self.state]

    def handle(self, event: EventT) -> bool:
        """Go to the state that follows; return False, and stay, where the present state refuses the event."""
        following = self._table[self.state].get(event)
        if following is None:
            return False
        self.state = following
        return True
