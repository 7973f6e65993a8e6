"""Many robots in one process: their publishers and tokens are those of bridges, a session is shared by fifty.

    python -m fleet.crowd ENDPOINT ROBOTS

Each robot publishes ``status`` and a warning once a second, the messages of a recorded run. Prints ``publishing`` when
all have begun, and after SIGTERM the number of warnings of each.
"""

from __future__ import annotations

import contextlib
import signal
import sys
import time

from fleet.watching import FLEET
from replays import messages
from zenoh_peers import session

from slipd_client.fleet.bridge_publisher import BridgePublisher
from slipd_client.messages import STATUS_TOPIC, WARNING_TOPIC, encode

A_SESSION = 50
"""Robots that share a session."""


def main() -> None:
    """Publish until SIGTERM."""
    endpoint, robots = sys.argv[1], int(sys.argv[2])
    ended: list[int] = []
    signal.signal(signal.SIGTERM, lambda number, _: ended.append(number))
    course = dict(messages("demo"))
    with contextlib.ExitStack() as stack:
        publishers = []
        for number in range(robots):
            if number % A_SESSION == 0:
                shared = stack.enter_context(session(endpoint))
            publishers.append(BridgePublisher(shared, FLEET, f"c{number:04d}"))
        begin_s, seq = time.monotonic(), 0
        while not ended:
            seq += 1
            for number, publisher in enumerate(publishers):
                time.sleep(max(0.0, begin_s + number / robots - time.monotonic()))
                for topic in (STATUS_TOPIC, WARNING_TOPIC):
                    header = {"seq": seq, "boot": f"b{number}", "t_ns": time.monotonic_ns()}
                    publisher.put(topic, encode(course[topic] | header))
                publisher.set_daemon_alive(True)
            begin_s = max(begin_s + 1.0, time.monotonic() - 1.0)
            if seq == 1:
                print("publishing", flush=True)
        time.sleep(1.0)  # what is published is also sent
        print(seq, flush=True)


if __name__ == "__main__":
    main()
