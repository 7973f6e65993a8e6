"""A publishing daemon in a process of its own: the daemon's publisher, with the messages of a recorded run, repeated.

    python -m fleet.robot PLAN      PLAN: JSON of `Plan`

What is left out of a whole daemon is the reading of sensors and the estimation, whose place the recording takes. Prints
``publishing`` when it serves, and the number of warnings it has published after SIGTERM.
"""

from __future__ import annotations

import asyncio
import json
import signal
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from slipd.io.bus.publisher import Publisher
from slipd_client.messages import WARNING_TOPIC, encode


@dataclass(frozen=True)
class Plan:
    """What to publish.

    Attributes:
        endpoint: Where.
        course: File of the recorded run: JSON list of seconds from its begin, topic, and body.
        boot: Id of this run.
        delay_s: When to begin, so that not all robots publish at once.
    """

    endpoint: str
    course: str
    boot: str
    delay_s: float


async def publish(plan: Plan, course: list[tuple[float, str, dict[str, Any]]]) -> None:
    """Publish until SIGTERM."""
    loop, stop = asyncio.get_running_loop(), asyncio.Event()
    loop.add_signal_handler(signal.SIGTERM, stop.set)
    seq: dict[str, int] = {}
    with Publisher(plan.endpoint) as publisher:
        print("publishing", flush=True)
        begin_s = time.monotonic() + plan.delay_s
        while not stop.is_set():
            for at_s, topic, body in course:
                if (wait_s := begin_s + at_s - time.monotonic()) > 0:
                    await asyncio.sleep(wait_s)
                if stop.is_set():
                    break
                seq[topic] = seq.get(topic, 0) + 1
                header = {"seq": seq[topic], "boot": plan.boot, "t_ns": time.monotonic_ns()}
                publisher.publish(topic, encode(body | header))
            begin_s += course[-1][0]
        await asyncio.sleep(0.5)  # what is published is also sent
    print(seq.get(WARNING_TOPIC, 0), flush=True)


if __name__ == "__main__":
    given = Plan(**json.loads(sys.argv[1]))
    asyncio.run(publish(given, json.loads(Path(given.course).read_text(encoding="utf-8"))))
