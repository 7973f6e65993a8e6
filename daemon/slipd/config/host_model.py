"""Keys of ``[realtime]``: what the daemon asks of its host."""

from __future__ import annotations

from pydantic import Field

from slipd.config.value_bounds import StrictModel


class Realtime(StrictModel):
    """``[realtime]``: how the host schedules the daemon.

    Attributes:
        priority: Real-time priority of the event loop (SCHED_FIFO); 0: none. From 50 on it would delay the interrupts
            of the sensors' own lines. Where it is not permitted, the daemon runs without and reports it in
            ``status``. Wrong: 0 beside programs that use all processors delays warnings.
        poll: The event loop polls instead of sleeping until a reading comes: warnings come about a tenth of
            a millisecond earlier, and one processor is busy all the time. Not with a priority: the kernel stops a
            real-time program that never sleeps. Wrong: true without a processor to spare delays warnings.
    """

    priority: int = Field(default=0, ge=0, le=49)
    poll: bool = False
