"""Evidence of motion of one finger: which sensors give it, and when it is forgotten."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from finger_bench import make_finger, read_force
from fixture_types import Parse, Wrench
from nanoseconds import MS, T0

from slipd.finger.contact_motion import ContactMotion
from slipd.finger.finger import Finger
from slipd.motion.vibration import BLOCK

Feel = Callable[..., None]


def motion_of(finger: Finger) -> ContactMotion:
    return finger.motion


@pytest.fixture
def feel(wrench: Wrench) -> Feel:
    """Blocks of force readings at 1 kHz, with noise that is ``loud`` times as large in the plane of the pad."""
    rng, now = np.random.default_rng(1), [T0]

    def feel(finger: Finger, blocks: int, loud: float = 1.0, normal_n: float = 8.0) -> None:
        for _ in range(blocks * BLOCK):
            now[0] += MS
            fx, fy, fz = rng.normal(0.0, 0.01, 3) * (loud, loud, 1.0)
            read_force(finger, wrench(now[0], normal_n + fz, (1.0 + fx, fy)))

    return feel


def test_the_sensors_decide_what_can_be_seen(left: str, parse: Parse) -> None:
    assert set(motion_of(make_finger(left, parse)).looks_per_hour) == {"image_change", "vibration"}
    slow = left.replace("rate_hz = 1000.0", "rate_hz = 400.0")
    assert set(motion_of(make_finger(slow, parse)).looks_per_hour) == {"image_change"}
    blind = left.split("[finger.left.pad]")[0]
    assert set(motion_of(make_finger(blind, parse)).looks_per_hour) == {"vibration"}


def test_a_finger_without_images_has_no_evidence_of_them(left: str, parse: Parse, finger: Finger) -> None:
    blind = motion_of(make_finger(left.split("[finger.left.pad]")[0], parse))
    with pytest.raises(ValueError, match="without images"):
        blind.confirm()
    blind.update_image(finger.image, T0, (0.0,) * 6)
    assert blind.take() == []
    with pytest.raises(ValueError, match="before it is confirmed"):
        motion_of(finger).confirm()


def test_evidence_from_elsewhere_is_a_slip_only_of_a_finger_that_touches_and_is_trusted(
    finger: Finger, wrench: Wrench
) -> None:
    assert finger.note_motion(T0 + 500 * MS, ("width",)) is None, "no reading yet"
    for t_ns, normal_n, status, slips in (
        (T0, 0.0, (), False),
        (T0 + MS, 8.0, ("invalid",), False),
        (T0 + 2 * MS, 8.0, (), True),
    ):
        read_force(finger, wrench(t_ns, normal_n, status=status))
        state = finger.note_motion(T0 + 500 * MS, ("width",))
        assert (state is not None) == slips
    assert (state.verdict.level, state.verdict.reasons[0]) == ("slipping", "slip_detected")


def test_a_loud_band_is_evidence_until_it_is_taken_or_its_contact_ends(finger: Finger, feel: Feel) -> None:
    motion = motion_of(finger)
    feel(finger, 30)
    assert motion.take() == []
    feel(finger, 3, loud=4.0)
    assert {evidence.kind for evidence in motion.take()} == {"vibration"}
    assert motion.take() == []
    feel(finger, 3, loud=8.0)
    assert motion.found
    feel(finger, 1, normal_n=0.0)
    assert motion.found == []
    feel(finger, 8, loud=4.0)
    assert motion.found == [], "the background of another contact is not that of this one"
