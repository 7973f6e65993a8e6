"""Steps of a course of an engine run: what happens, and what is expected then. A course is a list of steps."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest
from engine_rig import FULL_IMAGE, NO_IMAGE, Run, refusal_of

from slipd_client.messages import Health

Step = Callable[[Any], object]
"""Does something to a run, or checks it."""

bring_up: Step = Run.bring_up
lease: Step = Run.lease
let_lease_be: Step = Run.let_lease_be
tick: Step = Run.tick


def follow(run: Run, steps: Sequence[Step]) -> None:
    """Carry out the steps of a course."""
    for step in steps:
        step(run)


def play(text: str, steps: Sequence[Step] = (), *, zeros: bool = True) -> Run:
    """Carry out a course on a rig whose links are all up, and return its run."""
    run = Run(text, zeros=zeros)
    run.up()
    follow(run, steps)
    return run


def matches(found: Any, expected: Any) -> bool:
    """Return whether a value is as expected; a map may hold more than is expected of it."""
    if isinstance(expected, dict):
        return isinstance(found, dict) and all(matches(found[key], value) for key, value in expected.items())
    return bool(found == expected)


def ask(op: str, expected: Any = None, *, by: bytes = b"ann", times: int = 1, **fields: Any) -> Step:
    """Send a request.

    Args:
        op: The operation.
        expected: None: it is granted; a map: with this result; code and field: it is refused; a text: likewise, and the
            message holds this.
        by: The client.
        times: How often.
        fields: Fields of the request.
    """

    def step(run: Run) -> None:
        for _ in range(times):
            reply = run.ask(op, by, **fields)
            if isinstance(expected, str):
                assert expected in reply["error"]["message"], reply
            elif isinstance(expected, dict):
                assert matches(reply["result"], expected), reply
            else:
                assert refusal_of(reply) == expected, reply

    return step


def status(**expected: Any) -> Step:
    """Check parts of ``status``."""
    return ask("status", expected)


def newest(topic: str, **expected: Any) -> Step:
    """Check parts of the newest message of a topic."""

    def step(run: Run) -> None:
        assert matches(run.published(topic)[-1], expected), run.published(topic)[-1]

    return step


def level(level: str, *reasons: str, finger: str = "left") -> Step:
    """Check the newest verdict."""

    def step(run: Run) -> None:
        assert run.level(finger) == (level, list(reasons))

    return step


def wrench(*contact: Any, times: int = 1, **more: Any) -> Step:
    """Send readings of the left force sensor."""
    return lambda run: [run.wrench(*contact, **more) for _ in range(times)]


def skin(*contact: Any, times: int = 1, **more: Any) -> Step:
    """Send images of the right pad."""
    return lambda run: [run.skin(*contact, **more) for _ in range(times)]


def image(counts: Any = FULL_IMAGE) -> Step:
    """Send an image of the left pad."""
    return lambda run: run.image(counts)


no_image = image(NO_IMAGE)


def feel(normal_n: float) -> Step:
    """Send fresh readings of both fingers."""
    return lambda run: run.feel(normal_n)


def grip(force_n: float = 5.0) -> Step:
    """Close the gripper on an object."""
    return lambda run: run.grip(force_n)


def serve(ms: float) -> Step:
    """Let time pass while the gripper answers."""
    return lambda run: run.serve_gripper(ms)


def wait(ms: float) -> Step:
    """Let time pass without an event."""
    return lambda run: run.wait(ms)


def sleep(suspended_ns: int) -> Step:
    """Tick after the host slept."""
    return lambda run: run.tick(suspended_ns)


def down(*links: str) -> Step:
    """Unplug links."""
    return lambda run: [run.down(link) for link in links]


def up(*links: str) -> Step:
    """Plug links in."""
    return lambda run: run.up(*links)


def gripper(**changes: Any) -> Step:
    """Change what the gripper does."""
    return lambda run: [setattr(run.gripper, name, value) for name, value in changes.items()]


def commanded(**expected: Any) -> Step:
    """Check the command that the gripper has: ``position``, ``force``, ``go`` or ``activate``."""

    def step(run: Run) -> None:
        assert {name: getattr(run.gripper.command, name) for name in expected} == expected

    return step


def wrote(count: int | None = None) -> Step:
    """Check how many commands were written since the last call; None: forget them."""

    def step(run: Run) -> None:
        found = run.writes()
        assert count is None or len(found) == count, found

    return step


def count(topic: str, least: int, most: int | None = None) -> Step:
    """Check how many messages of a topic there were so far."""

    def step(run: Run) -> None:
        assert least <= len(run.published(topic)) <= (least if most is None else most)

    return step


def during(steps: Sequence[Step], topic: str, least: int, most: int | None = None) -> Step:
    """Check how many messages of a topic some steps cause."""

    def step(run: Run) -> None:
        before = len(run.published(topic))
        follow(run, steps)
        count(topic, before + least, before + (least if most is None else most))(run)

    return step


def health(stream: str, *words: str, severity: Health | None = None, without: str = "-") -> Step:
    """Check the message of a stream, and its severity: below an error unless it is named."""

    def step(run: Run) -> None:
        found = run.ask("status")["result"]["streams"][stream]
        assert found["health"] < Health.ERROR if severity is None else found["health"] == severity
        assert all(word in found["message"] for word in words), found["message"]
        assert without == "-" or without not in found["message"]

    return step


def got(expected_id: int, stream: str = "wrench", **more: Any) -> Step:
    """Check a tare of the left finger."""
    return ask("tare.get", {"tare_id": expected_id, "stream": stream} | more, finger="left", stream=stream)


def mu(value: float, by: str | None = "ann", source: str = "request") -> Step:
    """Check the friction of the left finger in ``status``."""
    return status(fingers={"left": {"mu": value, "mu_source": source, "mu_by": by}})


def approx(*offset: float) -> Any:
    """Return what an offset must be, to a millionth."""
    return pytest.approx(list(offset), abs=1e-6)


def slip(run: Run) -> None:
    """Let an object held with 5 N slip on the left finger, at less than half the load that stated friction carries."""
    for k in range(620):
        run.wrench(5.0, (0.6 + 0.001 * k if k < 580 else 0.9, 0.0))
        if k % 20 == 0:
            run.image(np.full((4, 4), 100 + k % 7))
            follow(run, [skin(5.0, ms=1.0), serve(5)])
