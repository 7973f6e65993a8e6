"""When a grip may be raised on the readings of a finger."""

from __future__ import annotations

from finger_bench import MS, T0, Image, Parse, Press, Wrench, read_force, verdict
from known_zeros import known_finger

from slipd.config import Levels
from slipd.finger.finger import Finger


def test_no_grip_is_raised_while_the_pad_is_silent(finger: Finger, press: Press) -> None:
    t_ns = press(10.0).t_ns
    press(10.1, ms=50.0, counts=None)
    assert finger.trust.for_raise(t_ns + 50 * MS)
    assert not finger.trust.for_raise(t_ns + 50 * MS + 1)
    finger.disconnect_image()
    assert not finger.trust.for_raise(t_ns + 50 * MS)
    press(10.0)
    assert finger.trust.for_raise(t_ns + 60 * MS)


def test_stale_s_of_the_config_does_not_allow_raises_on_old_readings(
    left: str, parse: Parse, wrench: Wrench, image: Image
) -> None:
    patient = parse(left.replace("rate_hz", "stale_s = 0.1\nrate_hz")).finger["left"]
    finger = known_finger("left", patient, Levels())
    finger.update_image(image(T0))
    read_force(finger, wrench(T0, 10.0))
    assert finger.check_silence(T0 + 100 * MS) is None
    assert finger.trust.for_raise(T0 + 50 * MS)
    assert not finger.trust.for_raise(T0 + 50 * MS + 1)
    assert verdict(finger.check_silence(T0 + 100 * MS + 1)) == ("unknown", ("stale",))
