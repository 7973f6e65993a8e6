"""The startup sequence: missing, late, repeated and refusing answers."""

from __future__ import annotations

from slipd.devices.shared.startup_sequence import ANSWER_NS, RETRY_PAUSE_NS, SILENCE_NS, StartupSequence, Step

STEPS = [
    Step("halt", b"h", "none", 20),
    Step("name", b"n", "optional"),
    Step("rate", b"r"),
    Step("go", b"g", "none"),
]


def begun(steps: list[Step] = STEPS) -> StartupSequence:
    talk = StartupSequence(steps)
    talk.start(0)
    return talk


def test_requests_are_sent_in_order_and_a_reading_makes_it_run() -> None:
    talk = begun()
    assert (talk.state, talk.due_ns, talk.awaited) == ("waiting", 0, "")
    assert talk.on_time(0) == b"h"
    assert talk.on_time(19) == b""
    assert talk.on_time(20) == b"n"
    assert talk.awaited == "name"
    talk.handle_answer(30)
    assert (talk.state, talk.awaited) == ("configuring", "")
    assert talk.on_time(30) == b"r"
    talk.handle_answer(40)
    assert talk.on_time(40) == b"g"
    talk.reading_received(50)
    assert (talk.state, talk.due_ns) == ("running", 50 + SILENCE_NS)


def test_a_closed_sequence_sends_nothing_and_has_no_deadline() -> None:
    talk = StartupSequence(STEPS)
    talk.reading_received(5)
    assert (talk.state, talk.due_ns, talk.on_time(10**12)) == ("closed", None, b"")
    talk.start(0)
    talk.on_time(0)
    talk.on_time(20)
    talk.stop()
    assert (talk.state, talk.due_ns, talk.awaited, talk.on_time(10**12)) == ("closed", None, "", b"")


def test_an_optional_request_is_sent_three_times_and_skipped() -> None:
    talk = begun()
    now_ns, written = 0, []
    while len(written) < 5:
        written.append(talk.on_time(now_ns))
        now_ns = talk.due_ns or 0
    assert written == [b"h", b"n", b"n", b"n", b"r"]


def test_an_unanswered_required_request_is_named_and_the_sequence_restarts() -> None:
    talk = begun(STEPS[2:])
    for attempt in range(3):
        assert talk.on_time(attempt * ANSWER_NS) == b"r"
    assert talk.on_time(3 * ANSWER_NS) == b""
    assert talk.state == "no answer to rate"
    assert talk.due_ns == 3 * ANSWER_NS + RETRY_PAUSE_NS
    assert talk.on_time(talk.due_ns) == b"r"
    assert talk.state == "no answer to rate"


def test_a_refusal_is_named_and_the_request_repeated_after_a_pause() -> None:
    talk = begun(STEPS[2:])
    talk.on_time(0)
    talk.handle_answer(7, "refused rate: too fast")
    assert (talk.state, talk.due_ns) == ("refused rate: too fast", 7 + RETRY_PAUSE_NS)
    assert talk.on_time(7 + RETRY_PAUSE_NS) == b"r"


def test_after_a_repeated_request_a_second_answer_is_ignored() -> None:
    talk = begun(STEPS[2:])
    talk.on_time(0)
    talk.on_time(ANSWER_NS)
    talk.handle_answer(ANSWER_NS + 5)
    assert (talk.awaited, talk.due_ns) == ("", 2 * ANSWER_NS + 5)


def test_a_request_may_have_its_own_timeout_and_a_sequence_may_restart_at_once() -> None:
    talk = StartupSequence([Step("boot", b"b", pause_ns=30, attempts=2)], rest_ns=0)
    talk.start(0)
    assert [talk.on_time(now_ns) for now_ns in (0, 29, 30, 59, 60)] == [b"b", b"", b"b", b"", b"b"]
    assert (talk.state, talk.due_ns) == ("no answer to boot", 90)


def test_after_a_reset_of_the_device_the_sequence_resumes_at_a_given_request() -> None:
    talk = begun(STEPS[2:])
    talk.on_time(0)
    talk.handle_answer(1)
    talk.resume(0, 70)
    assert (talk.state, talk.awaited) == ("configuring", "")
    assert [talk.on_time(now_ns) for now_ns in (1, 69, 70)] == [b"", b"", b"r"]


def test_the_silence_limit_depends_on_the_device() -> None:
    talk = StartupSequence(STEPS[3:], silence_ns=40)
    talk.start(0)
    talk.on_time(0)
    assert talk.due_ns == 40
    talk.reading_received(7)
    assert talk.due_ns == 47


def test_an_answer_may_make_the_next_request_unnecessary() -> None:
    talk = begun(STEPS[1:])
    talk.on_time(0)
    talk.handle_answer(1, skip=1)
    assert talk.on_time(1) == b"g"


def test_silence_after_the_last_request_restarts_the_sequence_and_is_named_if_nothing_was_received() -> None:
    talk = begun(STEPS[3:])
    assert talk.on_time(0) == b"g"
    assert talk.on_time(SILENCE_NS - 1) == b""
    assert talk.on_time(SILENCE_NS) == b"g"
    assert talk.state == "no answer to go"
    talk.reading_received(SILENCE_NS + 5)
    assert talk.state == "running"
    assert talk.on_time(2 * SILENCE_NS + 5) == b"g"
    assert talk.state == "waiting"
    assert talk.on_time(3 * SILENCE_NS + 5) == b"g"
    assert talk.state == "no answer to go"


def test_readings_between_the_requests_change_nothing() -> None:
    talk = begun(STEPS[2:])
    talk.on_time(0)
    talk.reading_received(3)
    assert (talk.state, talk.awaited, talk.due_ns) == ("waiting", "rate", ANSWER_NS)
