"""Every device has an emulator whose traffic decodes without a bad byte."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from nanoseconds import MS

from slipd.devices import DEVICES, Device
from slipd.tools.sim.emulators import Emulator, make_emulator
from slipd.types.samples import WrenchSample

SECONDS = 1.6
"""Long enough for a Bota sensor to boot and settle, and for a gripper to answer many polls."""

devices = pytest.mark.parametrize("device", list(DEVICES.values()), ids=list(DEVICES))


def plain(sample: Any) -> tuple[Any, ...]:
    fields = (getattr(sample, name) for name in sample.__slots__)
    return tuple(field.tolist() if isinstance(field, np.ndarray) else field for field in fields)


def play(
    device: Device,
    emulator: Emulator,
    seconds: float = SECONDS,
    load: Callable[[int], object] = lambda _: None,
) -> tuple[list[Any], Any]:
    """Run a device and its host in steps of a millisecond; return the readings and the counters."""
    session: Any = device.session(**emulator.options) if device.session is not None else None
    listener: Any = session or device.decoder(**emulator.options)
    samples: list[Any] = []
    emulator.opened(0)
    said = emulator.receive(session.start(0), 0) if session else []
    inquiry = device.inquiry(**emulator.options) if device.inquiry is not None else None
    if inquiry is not None:
        listener.receive(emulator.inquire(inquiry.request), 0)  # type: ignore[attr-defined]
    for now_ns in range(MS, round(seconds * 1000) * MS, MS):
        load(now_ns)
        for data in said + emulator.advance(now_ns):
            samples += listener.receive(data, now_ns)
        said = []
        while session and (due := session.next_deadline()) is not None and due <= now_ns:
            said += emulator.receive(session.on_time(now_ns), now_ns)
    return samples, listener.health


@devices
def test_its_traffic_decodes_without_a_bad_byte_at_its_rate(device: Device) -> None:
    emulator = make_emulator(device.name, 4)
    samples, health = play(device, emulator)
    assert (health.bad, health.bad_bytes, health.lost, health.duplicates, health.restarts) == (0, 0, 0, 0, 0)
    assert len(samples) == health.good
    streams = len({sample.source for sample in samples}) if device.shared else 1
    assert 0.4 * SECONDS * emulator.rate_hz < len(samples) < 1.1 * streams * SECONDS * emulator.rate_hz


@devices
def test_equal_seeds_give_equal_readings_and_others_do_not(device: Device) -> None:
    seconds = 0.6 if device.name == "bota" else 0.2  # the first readings of a Bota come late
    first, second, other = (
        [plain(sample) for sample in play(device, make_emulator(device.name, seed), seconds)[0]] for seed in (1, 1, 2)
    )
    assert first == second != []
    assert first != other or device.kind == "gripper"


LOADED_NS = round(SECONDS * 500) * MS
"""When the load begins."""

sensors = [name for name, device in DEVICES.items() if device.kind in ("wrench", "tactile")]


def numbers(sample: Any) -> Any:
    return np.array(sample.numbers) if isinstance(sample, WrenchSample) else sample.values


@pytest.mark.parametrize("name", [name for name in sensors if name != "pvdf"])  # its charge leaks away
def test_what_a_sensor_feels_is_what_its_readings_show(name: str) -> None:
    device, emulator = DEVICES[name], make_emulator(name, 4)
    shapes = {one.source: numbers(one).shape for one in play(device, make_emulator(name, 4), 0.7)[0]}
    loads = {
        source: np.array((1.5, -2.0, 4.0, 0.02, -0.03, 0.01))
        if device.kind == "wrench"
        else 40.0 + 30.0 * number + np.arange(np.prod(shape)).reshape(shape)
        for number, (source, shape) in enumerate(sorted(shapes.items()))
    }

    def feel(t_ns: int) -> None:
        for source, load in loads.items() if t_ns == LOADED_NS else ():
            if device.kind == "wrench":
                emulator.feel(load[:3], load[3:])  # type: ignore[attr-defined]
            else:
                emulator.press(load, *filter(None, [source]))  # type: ignore[attr-defined]

    samples, _ = play(device, emulator, load=feel)
    for source, load in loads.items():
        of_source = [one for one in samples if one.source == source]
        before = np.mean([numbers(one) for one in of_source if one.t_ns < LOADED_NS], axis=0)
        after = np.mean([numbers(one) for one in of_source if one.t_ns > LOADED_NS + 200 * MS], axis=0)
        assert after - before == pytest.approx(load, abs=0.01 if device.kind == "wrench" else 2.0)
