"""Keys of ``[realtime]`` and ``[restart]``: what the daemon asks of its host, and what it keeps for the next run."""

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


class Restart(StrictModel):
    """``[restart]``: what a run takes over from the run before it, on the same devices.

    Attributes:
        gap_s: Longest time between both runs, s; 0: nothing is kept. A tare was in use until the first run ended, so it
            may be older. An hour covers a crash, an update and a reboot; a sensor that rested for longer has cooled
            down or was changed. Wrong: too large, and verdicts rest on a zero that has moved; too small, and each
            restart needs a tare of free fingers.
    """

    gap_s: float = Field(default=3600.0, ge=0.0, le=604_800.0)
