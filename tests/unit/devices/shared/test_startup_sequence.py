"""The startup sequence: missing, late, repeated and refusing answers."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from slipd.devices.shared.sensor_session import ANSWER_NS, RETRY_PAUSE_NS, SILENCE_NS, StartupSequence, Step

STEPS = [
    Step("halt", b"h", "none", 20),
    Step("name", b"n", "optional"),
    Step("rate", b"r"),
    Step("go", b"g", "none"),
]
BOOT = [Step("boot", b"b", pause_ns=30, attempts=2)]
S, R = SILENCE_NS, RETRY_PAUSE_NS
LOST = 3 * ANSWER_NS
Course = list[tuple[str, int, bytes, str, int | None, str]]
"""What happens, when, what is then sent, the state, when more is due, and the request whose answer is awaited."""

COURSES: dict[str, tuple[list[Step], dict[str, Any], Course]] = {
    "requests are sent in order and a reading makes it run": (
        STEPS,
        {},
        [
            ("time", 0, b"h", "waiting", 20, ""),
            ("time", 19, b"", "waiting", 20, ""),
            ("time", 20, b"n", "waiting", 20 + ANSWER_NS, "name"),
            ("answer", 30, b"r", "configuring", 30 + ANSWER_NS, "rate"),
            ("answer", 40, b"g", "configuring", 40 + S, ""),
            ("reading", 50, b"", "running", 50 + S, ""),
        ],
    ),
    "an unanswered required request is named and the sequence restarts": (
        STEPS[2:],
        {},
        [
            *(("time", n * ANSWER_NS, b"r", "waiting", (n + 1) * ANSWER_NS, "rate") for n in range(3)),
            ("time", LOST, b"", "no answer to rate", LOST + R, ""),
            ("time", LOST + R, b"r", "no answer to rate", LOST + R + ANSWER_NS, "rate"),
        ],
    ),
    "a refusal is named and the request repeated after a pause": (
        STEPS[2:],
        {},
        [
            ("time", 0, b"r", "waiting", ANSWER_NS, "rate"),
            ("refusal", 7, b"", "too fast", 7 + R, ""),
            ("time", 7 + R, b"r", "too fast", 7 + R + ANSWER_NS, "rate"),
        ],
    ),
    "after a repeated request a second answer is ignored": (
        STEPS[2:],
        {},
        [
            ("time", 0, b"r", "waiting", ANSWER_NS, "rate"),
            ("time", ANSWER_NS, b"r", "waiting", 2 * ANSWER_NS, "rate"),
            ("answer", ANSWER_NS + 5, b"", "configuring", 2 * ANSWER_NS + 5, ""),
        ],
    ),
    "a request may have its own timeout and a sequence may restart at once": (
        BOOT,
        {"rest_ns": 0},
        [
            ("time", 0, b"b", "waiting", 30, "boot"),
            ("time", 29, b"", "waiting", 30, "boot"),
            ("time", 30, b"b", "waiting", 60, "boot"),
            ("time", 59, b"", "waiting", 60, "boot"),
            ("time", 60, b"b", "no answer to boot", 90, "boot"),
        ],
    ),
    "silence after the last request restarts the sequence and is named if nothing was received": (
        STEPS[3:],
        {},
        [
            ("time", 0, b"g", "waiting", S, ""),
            ("time", S - 1, b"", "waiting", S, ""),
            ("time", S, b"g", "no answer to go", 2 * S, ""),
            ("reading", S + 5, b"", "running", 2 * S + 5, ""),
            ("time", 2 * S + 5, b"g", "waiting", 3 * S + 5, ""),
            ("time", 3 * S + 5, b"g", "no answer to go", 4 * S + 5, ""),
        ],
    ),
}
HAPPENS: dict[str, Callable[[StartupSequence, int], None]] = {
    "time": lambda startup, now_ns: None,
    "answer": lambda startup, now_ns: startup.handle_answer(now_ns),
    "refusal": lambda startup, now_ns: startup.handle_answer(now_ns, "too fast"),
    "reading": lambda startup, now_ns: startup.reading_received(now_ns),
}


@pytest.mark.parametrize("name", COURSES)
def test_a_course_of_answers_gives_these_requests_and_states(name: str) -> None:
    steps, options, course = COURSES[name]
    startup = StartupSequence(steps, **options)
    startup.begin(0)
    for what, now_ns, sent, state, due_ns, awaited in course:
        HAPPENS[what](startup, now_ns)
        asked = startup.on_time(now_ns)
        waits = startup.awaited.name if startup.awaited else ""
        assert (asked, startup.state, startup.next_deadline(), waits) == (sent, state, due_ns, awaited), now_ns
