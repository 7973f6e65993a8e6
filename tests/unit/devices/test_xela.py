"""Messages of the XELA server: whole, split anywhere, among garbage, and with wrong numbers of values."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

from slipd.devices import xela
from slipd.types.samples import TactileSample

WORKED = (
    b'{"message":1476,"type":"routine","1":{"sensor":"1","model":"uSPa44","taxels":1,"time":.8365479,'
    b'"data":"B8BF,37B0,881E","calibrated":[0.7007,4.3194,-4.4254]}}'
)
"""Built from sample values published with a client; the number without a leading zero is as published."""
WELCOME = b'{"message":"Welcome"}'


def pad(number: int, taxels: int = 16) -> np.ndarray:
    return np.random.default_rng(number).integers(0, 1 << 16, size=(taxels, 3))


def message(number: int, **sensors: Any) -> bytes:
    return xela.encode_message(number, {"1": pad(number), **sensors}, 1_700_000_000.25)


def changed(**fields: Any) -> bytes:
    """Return a good message with two sensors, with changed fields of the first; None removes a field."""
    body = json.loads(xela.encode_message(1, {"1": pad(1), "2": pad(2)}, 1.0, {"1": pad(1), "2": pad(2)}))
    body["1"].update(fields)
    body["1"] = {key: value for key, value in body["1"].items() if value is not None}
    return json.dumps(body).encode()


def receive(data: bytes, *, calibrated: bool = False) -> tuple[list[TactileSample], xela.Decoder]:
    decoder = xela.Decoder(calibrated=calibrated)
    return decoder.receive(data, 77), decoder


def test_what_is_encoded_is_decoded_forevery_sensor() -> None:
    forces = np.linspace(-2, 2, 48).reshape(16, 3)
    data = xela.encode_message(3, {"1": pad(1), "12": pad(2, 24)}, 1_700_000_000.25, {"12": forces, "1": -forces})
    samples, _ = receive(data)
    assert [sample.source for sample in samples] == ["1", "12"]
    np.testing.assert_array_equal(samples[0].values, pad(1))
    np.testing.assert_array_equal(samples[1].values, pad(2, 24))
    assert samples[0].device_time_ns == 1_700_000_000_250_000_000


def test_integers_reach_from_nil_to_the_largest_of_sixteen_bits() -> None:
    samples, _ = receive(changed(data=[0, 1, 65_535] * 16))
    assert samples[0].values.tolist() == [[0.0, 1.0, 65_535.0]] * 16


def test_calibrated_values_are_used_if_configured() -> None:
    forces = np.linspace(-2, 2, 48).reshape(16, 3)
    data = xela.encode_message(3, {"1": pad(1), "2": pad(2)}, 1.0, {"1": forces})
    (sample,), decoder = receive(data, calibrated=True)
    np.testing.assert_array_equal(sample.values, forces)
    assert decoder.health.bad == 1  # the server calibrates only the first


NOTED_1_7_7 = b"""{"message": 983, "time": 1768296808.5623617, "sensors": 1, "type": "welcome",
"version": "1.7.7_161703", "1": {"time": 1768296808.5565615, "sensor": "1", "data": [33175, 33434, 37350],
"model": "uSPa11", "taxels": 1, "calibrated": [0.0031005585792, -0.0022188552824, 0.017302689426],
"extradots": [["1.0", "1.42", "21.62"]],
"special": [[33175, 33434, 37350, 0.0, 0, 0, 0, 0.0, 0, 0, 0, 0.0]], "temp": [0.0], "ups": [105.2]},
"complete": 1768296808.562364}"""
"""The message in the notes of a user of version 1.7.7 (see the docstring of the decoder), cut to one taxel."""


def test_a_message_that_a_user_noted_from_version_1_7_7_is_read() -> None:
    for calibrated, values in (
        (False, [33175.0, 33434.0, 37350.0]),
        (True, [0.0031005585792, -0.0022188552824, 0.017302689426]),
    ):
        (sample,), decoder = receive(NOTED_1_7_7, calibrated=calibrated)
        assert sample.values.tolist() == [values]
        assert sample.device_time_ns == pytest.approx(1_768_296_808_556_561_500, abs=1000)
        assert (decoder.health.bad, decoder.health.bad_bytes) == (0, 0)


def as_version_1_7_7(number: int, time_s: float, values: np.ndarray) -> dict[str, Any]:
    """Return a sensor with the fields of the server's version 1.7.7: a list of integers, and three further fields."""
    return {
        "sensor": str(number),
        "model": "uSPa46",
        "taxels": len(values),
        "time": time_s,
        "data": values.ravel().tolist(),
        "calibrated": (values.ravel() / 1225.0).tolist(),
        "special": [[*taxel, *[0.0] * 9] for taxel in values.tolist()],
        "ups": [105.2] * len(values),
        "temp": [31.25] * len(values),
    }


def test_a_whole_hand_from_version_1_7_7_is_read() -> None:
    hand = {str(n): as_version_1_7_7(n, 1_700_000_000.25, pad(n, 23)) for n in range(1, 17)}
    data = json.dumps({"message": 7, "type": "routine"} | hand).encode()
    assert len(data) > 32_768
    samples, decoder = receive(data)
    assert len(samples) == 16
    np.testing.assert_array_equal(samples[4].values, pad(5, 23))
    assert (decoder.health.bad, decoder.health.bad_bytes) == (0, 0)


def test_a_pad_with_fewer_taxels_than_the_model_of_the_server_is_named() -> None:
    values = pad(1)
    values[8:] = 0
    samples, decoder = receive(message(1, **{"2": values}))
    assert [sample.source for sample in samples] == ["1"]
    assert decoder.health.note == xela.NO_TAXELS.format("2", 8, 16)
    values[8] = 1
    assert len(decoder.receive(message(2, **{"2": values}), 78)) == 2
    assert decoder.health.note == ""


def test_a_server_that_goes_on_without_its_pad_is_named() -> None:
    decoder = xela.Decoder()
    for number, time_s, warning in ((1, 0.25, ""), (2, 0.25, xela.REPEATED.format("1")), (3, 0.26, "")):
        decoder.receive(xela.encode_message(number, {"1": pad(1)}, 1_700_000_000 + time_s), number)
        assert decoder.health.warning == warning
    decoder.forget()
    decoder.receive(xela.encode_message(1, {"1": pad(1)}, 1_700_000_000.26), 4)
    assert (decoder.health.warning, decoder.health.restarts) == ("", 0), "on a new line it is the first"


def test_the_welcome_is_skipped() -> None:
    samples, decoder = receive(WELCOME + message(1))
    assert len(samples) == 1
    assert (decoder.health.bad, decoder.health.bad_bytes) == (0, 0)


@pytest.mark.parametrize(
    "fields",
    [
        {"taxels": 15},
        {"taxels": 17},
        {"taxels": None},
        {"taxels": "16"},
        {"taxels": 0, "data": ""},
        {"taxels": 16.0},
        {"data": None},
        {"data": ",".join(["12345"] * 48)},
        {"data": ",".join(["-1"] * 48)},
        {"data": ",".join(["0x1"] * 48)},
        {"data": ",".join([" 1"] * 48)},
        {"data": ",".join(["1"] * 48) + ","},
        {"data": [1.0] * 48},
        {"data": [True] * 48},
        {"data": [-1] * 48},
        {"data": [1 << 16] * 48},
        {"data": [1] * 47},
    ],
)
def test_a_sensor_with_a_wrong_number_of_values_is_bad_and_its_neighbour_is_not(fields: dict[str, Any]) -> None:
    samples, decoder = receive(changed(**fields))
    assert [sample.source for sample in samples] == ["2"]
    assert (decoder.health.good, decoder.health.bad) == (1, 1)


@pytest.mark.parametrize(
    "values",
    [
        [1.0] * 47,
        [1.0] * 49,
        ["1"] * 48,
        [True] * 48,
        [None] * 48,
        [float("nan")] * 48,
        [1e400] * 48,
        [10**400] * 48,
        5,
    ],
)
def test_calibrated_values_that_are_not_forces_are_bad(values: Any) -> None:
    samples, decoder = receive(changed(calibrated=values), calibrated=True)
    assert [sample.source for sample in samples] == ["2"]
    assert decoder.health.bad == 1


@pytest.mark.parametrize("time", [None, "1", -1, 1e300, float("nan"), 10**400])
def test_an_impossible_time_is_unknown_and_the_reading_is_kept(time: Any) -> None:
    samples, _ = receive(changed(time=time))
    assert [sample.device_time_ns for sample in samples] == [None, 1_000_000_000]


@pytest.mark.parametrize(
    ("numbers", "counted"),
    [((1, 2, 3), (0, 0, 0)), ((1, 5), (3, 0, 0)), ((9, 9, 10), (0, 1, 0)), ((9, 1, 2, 4), (1, 0, 1))],
)
def test_D3_gaps_duplicates_and_restarts_are_counted_by_the_sequence_number(
    numbers: tuple[int, ...], counted: tuple[int, int, int]
) -> None:
    samples, decoder = receive(b"".join(message(number) for number in numbers))
    health = decoder.health
    assert (health.lost, health.duplicates, health.restarts) == counted
    assert len(samples) == health.good == len(numbers) - counted[1]


@pytest.mark.parametrize("body", [b"{}", b'{"1":{}}', b'{"message":1.5}', b'{"message":true}', b'{"message":null}'])
def test_an_object_without_a_number_is_bad(body: bytes) -> None:
    samples, decoder = receive(body + message(1))
    assert len(samples) == 1
    assert decoder.health.bad == 1


def test_each_stretch_of_garbage_counts_once() -> None:
    _, decoder = receive(b"xy" + message(1) + b"z" + message(2) + b" \r\n" + message(3))
    assert (decoder.health.good, decoder.health.bad, decoder.health.bad_bytes) == (3, 2, 3)


def test_a_number_with_two_dots_is_garbage_and_delays_nothing() -> None:
    samples, decoder = receive(b'{"message":1,"time":1.2.3}' + message(2))
    assert len(samples) == len(receive(message(2))[0])
    assert decoder.health.bad_bytes == len(b'{"message":1,"time":1.2.3}')
