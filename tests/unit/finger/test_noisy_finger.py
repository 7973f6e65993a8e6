"""Courses of a finger with noise on everything: faulty streams, sensors that contradict each other, unknown weight."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from finger_bench import NoisyFinger, read_force, taxel_faults, teach
from nanoseconds import MS

from slipd.types.arrays import Array
from slipd.types.samples import TactileSample, WrenchSample
from slipd_client.messages import Health

Step = Callable[[NoisyFinger], object]
STILL = (0.1, 0.0, -8.0)


def read(*reading: float, times: int = 1) -> Step:
    return lambda noisy: [noisy.read(*reading) for _ in range(times)]


def send(*force_n: float, spin_nm: float = 0.0) -> Step:
    """Send a reading without noise."""
    return lambda noisy: noisy.send(np.array(force_n), np.array((0.0, 0.0, spin_nm)))


def look(normal_n: float) -> Step:
    return lambda noisy: noisy.look(normal_n)


def hold(seconds: float, spoil: Callable[[Array], object] = lambda _: None, **contact: tuple[float, float]) -> Step:
    return lambda noisy: noisy.hold(seconds, spoil, **contact)


def later(ms: int) -> Step:
    return lambda noisy: vars(noisy).update(t_ns=noisy.t_ns + ms * MS)


def marked(image: tuple[str, ...], force: tuple[str, ...]) -> Step:
    """Send an image and a force that their devices mark."""

    def step(noisy: NoisyFinger) -> None:
        noisy.t_ns += MS
        noisy.finger.update_image(TactileSample(noisy.t_ns, None, np.full(16, 50.0), image))
        noisy.state = read_force(noisy.finger, WrenchSample(noisy.t_ns, None, STILL, np.zeros(3), force))

    return step


def without_torque(noisy: NoisyFinger) -> None:
    for k in range(40):
        later(10)(noisy)
        force = np.array((0.1, 0.0, -8.0 - 2.0 * math.sin(0.5 * k))) + noisy.rng.normal(0.0, 0.002, 3)
        noisy.state = read_force(noisy.finger, WrenchSample(noisy.t_ns, None, force, None))
        noisy.look(-force[2])


def tare(noisy: NoisyFinger) -> None:
    """Tare the force sensor."""
    before = noisy.finger.tare.current.id
    noisy.finger.begin_tare(noisy.t_ns, 0.01, "someone")
    read(0.0, times=20)(noisy)
    assert noisy.finger.tare.current.id == before + 1


def pad_of_the_config(noisy: NoisyFinger) -> None:
    pad = noisy.finger.image.tare
    pad.put(replace(pad.current, origin="config"))


def carried(noisy: NoisyFinger) -> None:
    """A named object was carried beyond the stated friction."""
    noisy.finger.friction.set_object("mug")
    hold(0.3)(noisy)
    teach(noisy.finger, 0.8)


def says(level: str, *reasons: str) -> Step:
    def step(noisy: NoisyFinger) -> None:
        assert noisy.verdict == (level, reasons)

    return step


def at(*levels: str, among: tuple[str, ...] = ()) -> Step:
    """Check the level, and some of the reasons."""

    def step(noisy: NoisyFinger) -> None:
        assert noisy.verdict[0] in levels
        assert set(among) <= set(noisy.verdict[1])

    return step


def health(stream: str, *expected: tuple[Health, str]) -> Step:
    """Check the conditions of a stream: severities, and how each text begins."""

    def step(noisy: NoisyFinger) -> None:
        found = noisy.conditions(stream)
        assert len(found) == len(expected)
        for (level, text), (severity, words) in zip(found, expected, strict=True):
            assert (level, text[: len(words)]) == (severity, words)

    return step


def masked(faults: dict[str, list[int]], mended: int | None = None) -> Step:
    """Check the masked taxels, and that one was replaced by its neighbours."""

    def step(noisy: NoisyFinger) -> None:
        assert taxel_faults(noisy.finger) == faults
        assert mended is None or 0.3 < noisy.finger.image.pressure[mended] < 1.0

    return step


def pressed(expected: bool | None) -> Step:
    def step(noisy: NoisyFinger) -> None:
        assert noisy.finger.presence.is_pressed() is expected

    return step


def mu(expected: float) -> Step:
    def step(noisy: NoisyFinger) -> None:
        assert (noisy.finger.friction.state.mu, noisy.finger.friction.state.object_name) == (
            pytest.approx(expected), "mug",
        )  # fmt: skip

    return step


def not_drifted(noisy: NoisyFinger) -> None:
    assert noisy.finger.force.drift.value[2] == pytest.approx(0.0, abs=0.01)
    assert noisy.verdict[1][0] == "disagreement"


def limited(noisy: NoisyFinger) -> None:
    """Without the force sensor, the integral of a charge that does not leak would run away."""
    assert noisy.finger.image.pressure.sum() < 10.0 + 8.0 * 2.0 / 2.0


def set_to(taxels: slice, counts: float) -> Callable[[Array], object]:
    return lambda image: image.__setitem__(taxels, counts)


STABLE, UNSEEN, HIDDEN = says("stable"), says("unknown", "rotation_unobserved"), says("unknown", "weight_unknown")
FREE, LESS = says("no_contact"), lambda counts: np.multiply(counts, 0.3, out=counts)
SPLIT = says("unknown", "disagreement", "disagreement_force")
ERROR, WARN = Health.ERROR, Health.WARN
WELL = health("wrench")
CALIBRATED, HEAVY = "gain_error = 0.05\n", "mass_kg = 0.1\n"
COURSES: dict[str, tuple[str, str, list[Step]]] = {
    **{
        f"F1 a force sensor that repeats is stuck until it changes, unless it may rest: {more}": (
            more, "", [*[look(8.0), send(*STILL)] * 61, *stuck, read(8.0), STABLE, WELL],
        )
        for more, stuck in (
            ("", [says("unknown", "stuck"), health("wrench", (ERROR, ""))]), ("stuck_after = 0", [STABLE, WELL]),
        )
    },
    "F1 an intermittent stream is reported and used while it runs": (
        "", "",
        [*[read(0.0, times=20), later(300)] * 4, read(0.0), FREE,
         health("wrench", (WARN, "it failed several times within 10 s"))],
    ),
    **{
        f"F1 a single reading of {force_n} N and {spin_nm} N·m is garbage with {more}": (
            more, "",
            [look(8.0), read(8.0), STABLE, send(0.0, 0.0, force_n - 8.0, spin_nm=spin_nm), says("unknown", "garbage"),
             lambda noisy: out_of_range(noisy), read(8.0, times=40)] * 2,
        )
        for more in ("stuck_after = 0\nrange_n = 100.0\n", "range_n = 80.0", "range_n = 100.0\nrange_nm = 5.0")
        for force_n, spin_nm in ((500.0, 0.0), (-3e38, 0.0), (0.0, 3e38), (1e120, 1e120))
    },
    **{
        f"T1 T3 bad taxels are masked, and a pad that hangs is not used: {text}": (
            "", "full_scale = 4095.0\n",
            [hold(1.2, set_to(taxels, counts)), masked(*faults), verdict, health("pad", (severity, text)), *after],
        )
        for taxels, counts, faults, verdict, severity, text, after in (
            (slice(5, 6), 0.0, ({"dead": [5]}, 5), STABLE, WARN, "taxels are masked: dead 5", []),
            (slice(10, 11), 4095.0, ({"saturated": [10]}, 10), STABLE, WARN, "taxels are masked: saturated 10", []),
            (slice(8), 4095.0, ({"row": [0, 1]},), UNSEEN, ERROR, "too many taxels are masked: row 0, 1", []),
            (slice(16), 50.0, ({},), says("unknown", "stuck", "rotation_unobserved"), ERROR,
             "its images repeat while the force moves: it hangs", [hold(0.3), STABLE]),
        )
    },
    **{
        f"F2 the status {word} of a device shows in the health of its stream": (
            "", "",
            [marked((), (word,)), at(level), health("pad"), health("wrench", told),
             marked((word,), ()), at(level), health("pad", told), WELL],
        )
        for word, level, told in (
            ("overload", "unknown", (ERROR, "the device reports: overload")),
            ("invalid", "unknown", (ERROR, "the device reports: invalid")),
            ("skipped", "stable", (WARN, "the device reports: skipped")),
        )
    },
    "N1 readings that are not finite are reported as such": (
        "", "",
        [*[send(*[math.nan] * 3), says("unknown", "not_finite")] * 10,
         health("wrench", (ERROR, "its readings are not finite numbers"))],
    ),
    "F3 a centroid that the image does not show is a disagreement": (
        "", "",
        [hold(0.3), STABLE, hold(0.3, at_m=(0.005, 0.0)), says("unknown", "disagreement", "disagreement_centroid"),
         hold(0.5), STABLE],
    ),
    "F3 a force that a calibrated image does not show is one, and the comparison starts anew": (
        "", CALIBRATED,
        [hold(0.3), STABLE, hold(0.3, LESS), SPLIT, lambda noisy: noisy.finger.disconnect_image(), read(8.0), UNSEEN],
    ),
    "a force without torque has no centroid to compare": ("", "", [without_torque, UNSEEN]),
    **{
        f"N3 a load beyond any grip is a warning: {reason}": (
            "", "", [look(8.0), send(pull_n, 0.0, -8.0, spin_nm=spin_nm), says("warning", reason)],
        )
        for pull_n, spin_nm, reason in ((0.0, 9e5, "rotation"), (9e5, 0.0, "translation"))
    },
    "a grasp whose force and image disagree teaches nothing of its object": (
        "", CALIBRATED,  # its readings were wrong already before that was noticed
        [carried, mu(0.8), hold(0.3, LESS), SPLIT, mu(0.5), send(0.0, 0.0, 0.0), mu(0.5)],
    ),
    "a calibrated charge pad is anchored to the force sensor": (
        "", "gain_error = 0.05\ncharge_tau_s = 2.0\n",
        [*[later(19), read(0.0), look(0.0)] * 50,
         *(step for k in range(200) for n in [8.0 + 2.0 * math.sin(0.5 * k)] for step in (later(9), read(n), look(n))),
         limited],
    ),
    # what the weight of the finger may add, or hide
    "an uncertain weight raises the upper bound of utilisation, and may be all that presses": (
        HEAVY, "",
        [look(2.0), read(2.0, 0.5), at("warning"),  # λ may reach (0.5 + 0.98 / μ...) / (2.0 − 0.98)
         look(0.9), read(0.9, 0.1), says("warning", "translation", "weight_unknown")],
    ),
    "a centroid that the weight may have moved outside is tipping": (
        "mass_kg = 0.01\ncom_m = [0.0, 0.0, -0.6]\n", "",
        [look(5.0), read(5.0), at("caution", "warning", among=("tipping", "weight_unknown"))],
    ),
    **{
        f"a finger that reads {n} N is not free while its weight may hide a contact": (
            HEAVY, "",
            [tare, read(n), HIDDEN, pressed(None),
             lambda noisy: noisy.finger.force.set_gravity([0.0, 0.0, -9.8], noisy.t_ns), tare, FREE, pressed(False),
             # after the host slept, the orientation is unknown
             lambda noisy: noisy.finger.force.gravity.forget(), read(n), HIDDEN],
        )
        for n in (0.0, 0.3)
    },
    **{
        f"a free finger of unknown weight is free where its pad shows that: {bool(pad)}": (
            HEAVY, pad,
            [pad_of_the_config, tare, look(0.0), read(0.2), *free,
             look(2.0), read(0.0), HIDDEN, look(0.0), read(0.2), HIDDEN,  # what the pad shows, or showed lately
             *[later(19), look(0.0)] * 12, read(0.2), *free,
             look(0.0), read(0.0, times=200), HIDDEN],  # the image is too old
        )
        for pad, free in ((f"tare = {[0.0] * 16}\n", [FREE, pressed(False)]), ("", [HIDDEN, pressed(None)]))
    },
    "a held load that the pad does not show is no drift": (
        "drift_tau_s = 20.0\n", "", [*[later(99), read(1.5), look(0.0)] * 600, not_drifted],
    ),
}  # fmt: skip


def out_of_range(noisy: NoisyFinger) -> None:
    level, message = noisy.conditions("wrench")[0]
    assert (level, "out of range_n or range_nm" in message) == (Health.ERROR, True)


@pytest.mark.parametrize("name", COURSES)
def test_F1_F2_F3_N1_N3_T1_T3_a_course_of_a_noisy_finger(make_noisy: Callable[..., NoisyFinger], name: str) -> None:
    wrench, pad, steps = COURSES[name]
    noisy = make_noisy(wrench, pad)
    for step in steps:
        step(noisy)
