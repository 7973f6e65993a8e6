"""The startup sequence: missing, late, repeated and refusing answers."""

from __future__ import annotations

from slipd.devices.shared.sensor_session import ANSWER_NS, RETRY_PAUSE_NS, SILENCE_NS, StartupSequence, Step

STEPS = [
    Step("halt", b"h", "none", 20),
    Step("name", b"n", "optional"),
    Step("rate", b"r"),
    Step("go", b"g", "none"),
]


def started(steps: list[Step] = STEPS) -> StartupSequence:
    startup = StartupSequence(steps)
    startup.start(0)
    return startup


def test_requests_are_sent_in_order_and_a_reading_makes_it_run() -> None:
    startup = started()
    assert (startup.state, startup.due_ns, startup.awaited) == ("waiting", 0, "")
    assert startup.on_time(0) == b"h"
    assert startup.on_time(19) == b""
    assert startup.on_time(20) == b"n"
    assert startup.awaited == "name"
    startup.handle_answer(30)
    assert (startup.state, startup.awaited) == ("configuring", "")
    assert startup.on_time(30) == b"r"
    startup.handle_answer(40)
    assert startup.on_time(40) == b"g"
    startup.reading_received(50)
    assert (startup.state, startup.due_ns) == ("running", 50 + SILENCE_NS)


def test_a_closed_sequence_sends_nothing_and_has_no_deadline() -> None:
    startup = StartupSequence(STEPS)
    startup.reading_received(5)
    assert (startup.state, startup.due_ns, startup.on_time(10**12)) == ("closed", None, b"")
    startup.start(0)
    startup.on_time(0)
    startup.on_time(20)
    startup.stop()
    assert (startup.state, startup.due_ns, startup.awaited, startup.on_time(10**12)) == ("closed", None, "", b"")


def test_an_unanswered_required_request_is_named_and_the_sequence_restarts() -> None:
    startup = started(STEPS[2:])
    for attempt in range(3):
        assert startup.on_time(attempt * ANSWER_NS) == b"r"
    assert startup.on_time(3 * ANSWER_NS) == b""
    assert startup.state == "no answer to rate"
    assert startup.due_ns == 3 * ANSWER_NS + RETRY_PAUSE_NS
    assert startup.on_time(startup.due_ns) == b"r"
    assert startup.state == "no answer to rate"


def test_a_refusal_is_named_and_the_request_repeated_after_a_pause() -> None:
    startup = started(STEPS[2:])
    startup.on_time(0)
    startup.handle_answer(7, "refused rate: too fast")
    assert (startup.state, startup.due_ns) == ("refused rate: too fast", 7 + RETRY_PAUSE_NS)
    assert startup.on_time(7 + RETRY_PAUSE_NS) == b"r"


def test_after_a_repeated_request_a_second_answer_is_ignored() -> None:
    startup = started(STEPS[2:])
    startup.on_time(0)
    startup.on_time(ANSWER_NS)
    startup.handle_answer(ANSWER_NS + 5)
    assert (startup.awaited, startup.due_ns) == ("", 2 * ANSWER_NS + 5)


def test_a_request_may_have_its_own_timeout_and_a_sequence_may_restart_at_once() -> None:
    startup = StartupSequence([Step("boot", b"b", pause_ns=30, attempts=2)], rest_ns=0)
    startup.start(0)
    assert [startup.on_time(now_ns) for now_ns in (0, 29, 30, 59, 60)] == [b"b", b"", b"b", b"", b"b"]
    assert (startup.state, startup.due_ns) == ("no answer to boot", 90)


def test_silence_after_the_last_request_restarts_the_sequence_and_is_named_if_nothing_was_received() -> None:
    startup = started(STEPS[3:])
    assert startup.on_time(0) == b"g"
    assert startup.on_time(SILENCE_NS - 1) == b""
    assert startup.on_time(SILENCE_NS) == b"g"
    assert startup.state == "no answer to go"
    startup.reading_received(SILENCE_NS + 5)
    assert startup.state == "running"
    assert startup.on_time(2 * SILENCE_NS + 5) == b"g"
    assert startup.state == "waiting"
    assert startup.on_time(3 * SILENCE_NS + 5) == b"g"
    assert startup.state == "no answer to go"
