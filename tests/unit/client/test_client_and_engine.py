"""The client's requests to a daemon's engine, without sockets and in simulated time."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from engine_rig import LEFT, Run

from slipd.events import Reply
from slipd_client.errors import RequestRefused, TareGivenUp
from slipd_client.messages import decode, encode
from slipd_client.request_protocol import Ask, Pause, RequestProtocol, Steps


class Client:
    """One client of a run: what it sends and what it gets are bytes."""

    def __init__(self, run: Run, name: bytes = b"ann") -> None:
        self.run, self.name = run, name
        self.protocol = RequestProtocol("ipc:///nowhere", lambda: run.t_ns, lambda _: None)

    def carry_out(self, steps: Steps[Any], meanwhile: Callable[[], object]) -> Any:
        """Return what the steps return; ``meanwhile`` happens every 5 ms in which they wait."""
        try:
            step = next(steps)
            while True:
                if isinstance(step, Pause):
                    for _ in range(round(step.seconds / 0.005)):
                        meanwhile()
                    step = next(steps)
                    continue
                try:
                    result = self._exchange(step)
                except RequestRefused as refusal:
                    step = steps.throw(refusal)
                else:
                    step = steps.send(result)
        except StopIteration as done:
            return done.value

    def _exchange(self, ask: Ask) -> dict[str, Any]:
        envelope = self.protocol.pack(ask)
        self.run.wait(1)
        outputs = self.run.request(self.name, decode(envelope.data))
        (reply,) = (output for output in outputs if isinstance(output, Reply))
        result = self.protocol.result(envelope, [encode(reply.body)])
        assert result is not None
        return result


@pytest.fixture
def run() -> Run:
    run = Run(LEFT)
    run.up()
    for _ in range(20):
        run.wrench(0.0, ms=5)
    return run


@pytest.mark.parametrize(
    ("then", "code", "reason"),
    [
        (lambda run: run.wrench(0.0, ms=5), "", ""),
        (lambda run: run.wrench(10.0, ms=5), "in_contact", "contact"),
        (
            lambda run: run.wrench(0.0, ms=5) and run.ask("tare.undo", client=b"bob", finger="left"),
            "not_ready",
            "undone",
        ),
        (lambda run: (run.wait(5), run.tick()), "not_ready", "silent"),
        (lambda run: (run.wait(5), run.tick(), run.down("left.wrench")), "not_ready", "ended"),
    ],
)
def test_a_tare_is_taken_or_reported_as_what_it_was_given_up_for(
    run: Run, then: Callable[[Run], object], code: str, reason: str
) -> None:
    client = Client(run)
    steps = client.protocol.tare("left", 10.0 if code else 0.5, 5.0)
    if code:
        with pytest.raises(TareGivenUp) as caught:
            client.carry_out(steps, lambda: then(run))
        assert (caught.value.code, caught.value.reason) == (code, reason)
    else:
        taken = client.carry_out(steps, lambda: then(run)).tares["wrench"]
        assert taken.tare_id == 1
        assert taken.readings > 50


def test_a_more_lenient_friction_needs_the_lease_and_a_released_one_is_free_for_the_next(run: Run) -> None:
    ann, bob = Client(run), Client(run, b"bob")

    def ask(client: Client, op: str, **fields: Any) -> Any:
        return client.carry_out(client.protocol.request(op, fields), run.tick)

    ask(ann, "lease.acquire", ttl_ms=200)
    with pytest.raises(RequestRefused, match=r"no_lease: mu_s 0\.6 over 0\.5 .* another client holds the lease"):
        ask(bob, "friction.set", finger="left", mu_s=0.6)
    assert ask(ann, "friction.set", finger="left", mu_s=0.6).mu == 0.6
    ask(ann, "lease.release")
    with pytest.raises(RequestRefused, match="no_lease"):
        ask(bob, "friction.set", finger="left", mu_s=0.9)
    ask(bob, "lease.acquire", ttl_ms=200)
    assert ask(bob, "friction.set", finger="left", mu_s=0.9).mu == 0.9
    assert ask(bob, "status").fingers["left"].mu == 0.9
