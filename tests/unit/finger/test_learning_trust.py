"""What a finger learns of friction is never from readings that are not trusted, nor a raise allowed on them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from finger_bench import FULL, Press, make_finger, verdict
from fixture_types import Parse
from nanoseconds import MS

from slipd.finger.finger import Finger
from slipd.finger.freshness import Arrival


def hold(press: Press, pull_n: float, seconds: float = 0.4, counts: np.ndarray | None = FULL, **how: Any) -> int:
    """Hold with 10 N against a pull, read at 100 Hz with images that flicker; return when."""
    rng = np.random.default_rng(1)
    for _ in range(round(100 * seconds)):
        shown = None if counts is None else counts + rng.integers(0, 2, (4, 4))
        state = press(10.0, (pull_n, 0.0), counts=shown, **how)
    return state.t_ns


@pytest.mark.parametrize(
    ("how", "mu"),
    [
        ({}, 0.6),
        ({"status": ("overload",)}, 0.5),
        ({"status": ("invalid",)}, 0.5),
        ({"image_status": ("invalid",)}, 0.5),
        ({"counts": None}, 0.5),
        ({"arrival": Arrival(waited_ns=MS)}, 0.5),
    ],
)
def test_a_load_above_the_stated_friction_that_is_held_raises_it_unless_it_is_doubtful(
    finger: Finger, press: Press, how: dict[str, Any], mu: float
) -> None:
    hold(press, 1.0)
    hold(press, 6.0, 0.1, counts=None)  # the image before is too old by then
    hold(press, 6.0, **how)
    assert finger.friction.state.mu == pytest.approx(mu, rel=0.05 if mu > 0.5 else 0.0)


@pytest.mark.parametrize("hangs", [False, True])
def test_what_is_not_known_to_be_right_raises_nothing(
    left: str, parse: Parse, make_press: Callable[[Finger], Press], hangs: bool
) -> None:
    """A sensor without a known zero, and one that hangs at the peak of a load, which it holds for ever."""
    text = left.replace("stuck_after = 0", "stuck_after = 1000") if hangs else left
    finger = make_finger(text, parse, zeros=hangs)
    press = make_press(finger)
    t_ns = hold(press, 6.0)
    assert finger.friction.state.mu == 0.5
    finger.note_motion(t_ns + 300 * MS, ("external",))
    hold(press, 8.0)
    assert finger.friction.state.mu <= 0.5, "a slip lowers it, at most"


def test_a_short_shock_when_another_process_reports_motion_does_not_raise_friction(
    finger: Finger, press: Press
) -> None:
    finger.note_motion(hold(press, 2.0) + 300 * MS, ("external",))
    hold(press, 9.0, 0.01)
    hold(press, 2.0)
    assert finger.friction.state.mu <= 0.5


def test_no_grip_is_raised_while_the_pad_is_silent(finger: Finger, press: Press) -> None:
    t_ns = press(10.0).t_ns
    press(10.1, ms=50.0, counts=None)
    assert [finger.trust.for_raise(t_ns + 50 * MS + k) for k in (0, 1)] == [True, False]
    finger.disconnect_image()
    assert not finger.trust.for_raise(t_ns + 50 * MS)
    press(10.0)
    assert finger.trust.for_raise(t_ns + 60 * MS)


def test_stale_s_of_the_config_does_not_allow_raises_on_old_readings(
    left: str, parse: Parse, make_press: Callable[[Finger], Press]
) -> None:
    finger = make_finger(left.replace("rate_hz", "stale_s = 0.1\nrate_hz"), parse)
    t_ns = make_press(finger)(10.0).t_ns
    assert finger.check_silence(t_ns + 100 * MS) is None
    assert [finger.trust.for_raise(t_ns + 50 * MS + k) for k in (0, 1)] == [True, False]
    assert verdict(finger.check_silence(t_ns + 100 * MS + 1)) == ("unknown", ("stale",))
