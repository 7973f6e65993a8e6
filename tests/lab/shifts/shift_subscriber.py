"""A healthy subscriber of everything, as a process: ``python -m shifts.shift_subscriber ENDPOINT``.

Prints ``ready`` with its first message, and on SIGTERM how many messages came and how many are missing.
"""

from __future__ import annotations

import json
import signal
import sys
import time

from slipd_client.subscriber import Subscriber

QUIET_S = 0.5
"""After the last message nothing comes for so long."""


def main() -> None:
    """Count until SIGTERM, and then what still comes."""
    ended: list[int] = []
    signal.signal(signal.SIGTERM, lambda number, _: ended.append(number))
    messages = missed = 0
    heard_s = time.monotonic()
    with Subscriber(sys.argv[1], ("",), silence_s=None) as subscriber:
        while not ended or time.monotonic() - heard_s < QUIET_S:
            message = subscriber.receive(0.1)
            if message is None:
                continue
            heard_s = time.monotonic()
            if not messages:
                print("ready", flush=True)
            messages += 1
            missed += message.missed
    print(f"heard {json.dumps([messages, missed])}", flush=True)


if __name__ == "__main__":
    main()
