"""Options of a decoder or a session that no device can have are refused in words; those at the limits are not."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from slipd.devices import (
    bota,
    dsacon32,
    external_gripper,
    gauges,
    netft,
    optoforce,
    papillarray,
    pvdf,
    robotiq_2f,
    robotous,
    tsf85,
    wsg,
    wts,
)

EYE = np.eye(6)
NEARLY_SINGULAR = EYE.copy()
NEARLY_SINGULAR[1, :2] = 1.0, 2.3e-6  # an angle between two rows that gives a condition of 0.87 million
TOO_NEARLY = EYE.copy()
TOO_NEARLY[1, :2] = 1.0, 1.7e-6  # 1.18 million
DOUBLED = EYE.copy()
DOUBLED[5] = 2 * DOUBLED[0]
NO_MATRIX = [
    *(EYE[:5].tolist(), EYE[:, :5].tolist(), [[1.0], [1.0, 2.0]], EYE.ravel().tolist(), [["a"] * 6] * 6),
    *([[math.nan] * 6] * 6, [[math.inf] * 6] * 6, (1.01e6 * EYE).tolist()),
]
XML: dict[str, Any] = {"calibration": "xml"}

REFUSED: dict[str, list[tuple[Callable[..., Any], dict[str, list[Any]], dict[str, Any]]]] = {
    "64 to 2047, got": [(bota.Session, {"sinc_length": [0, 63, 2048, 64.0]}, {})],
    "1 to 255, got": [
        (tsf85.Session, {"period_ms": [0, 256, 1.5]}, {}),
        (optoforce.Session, {"period_ms": [0, 256]}, {"wiring": "udp"}),
    ],
    "a positive integer, got": [(tsf85.Decoder, {"timestamp_unit_ns": [0, -1, 1.5]}, {})],
    "100, 250, 500, 1000, got": [(papillarray.Session, {"rate_hz": [0, 200, 2000]}, {})],
    "1 to 30, got": [(dsacon32.Session, {"rate_hz": [0, 31, 2.5]}, {})],
    "0 to 65535, got": [(wts.Session, {"interval_ms": [-1, 65_536, 2.5]}, {})],
    "1 to 16 matrices, got": [(dsacon32.Decoder, {"matrices": [[], [[1, 1]] * 17]}, {})],
    "columns and rows, integers": [
        (dsacon32.Decoder, {"matrices": [[[6, 14], [0, 3]], [[6, 2.5]], [[6, math.nan]], [[6]]]}, {})
    ],
    "at most 2048 cells, got 4096": [(dsacon32.Decoder, {"matrices": [[[64, 64]]]}, {})],
    "internal_hz": [(netft.Decoder, {"internal_hz": [-1, 0.99, 1.01e6, math.nan, math.inf]}, {})],
    "output_hz must be an integer from 1 to 7912, or 0": [(netft.Session, {"output_hz": [-1, 0.5, 7913]}, XML)],
    'needs calibration = "xml"': [(netft.Session, {"output_hz": [1000]}, {})],
    "one of tcp, xml, config, got": [(make, {"calibration": ["guess"]}, {}) for make in (netft.inquiry, netft.Session)],
    "one of serial, udp, got": [(make, {"wiring": ["usb"]}, {}) for make in (optoforce.Decoder, optoforce.Session)],
    "from 0 to 3, got": [(make, {"channel": [4, -1]}, {}) for make in (optoforce.Decoder, optoforce.Session)],
    "three finite numbers, none of them zero": [
        (make, {"counts_per_n": [[1.0, 2.0], [1.0, 0.0, 1.0]], "counts_per_nm": [[1.0, math.nan, 1.0]]}, {})
        for make in (optoforce.Decoder, optoforce.Session)
    ],
    "one of 1, 3, 10, 33, 100, got": [(optoforce.Session, {"period_ms": [0, 2, 255]}, {})],
    "one of 0, 500, 150, 50, 15, 5, 1.5, got": [(optoforce.Session, {"filter_hz": [100.0]}, {})],
    "at least 1, got": [(robotous.Decoder, {"torque_divider": [0, 0.9, -2000, math.nan, math.inf]}, {})],
    "must be one of": [(robotous.Session, {"output_hz": [400, 0], "filter_hz": [4]}, {})],
    "1 to 256, got": [(pvdf.Decoder, {"rows": [0, 257], "cols": [0, 257]}, {})],
    "must not be .nearly. singular": [
        (gauges.Decoder, {"matrix": [each.tolist() for each in (DOUBLED, TOO_NEARLY, 0 * EYE, EYE**0)]}, {})
    ],
    "matrix must be 6 x 6 finite numbers": [(gauges.Decoder, {"matrix": NO_MATRIX}, {})],
    "offset must be 6 finite numbers": [
        (gauges.Decoder, {"offset": [[1.0] * 5, [math.nan] * 6, 3.0, [2.0**32 + 1] * 6]}, {})
    ],
    "at least 0.005, got": [(robotiq_2f.Session, {"poll_period_s": [0.0, 0.004, -1, math.nan]}, {})],
    "1 to 247, got": [(robotiq_2f.Session, {"unit": [0, 248, 9.0]}, {})],
    "5 to 200, got": [(wsg.Session, {"period_ms": [4, 201, 20.0]}, {})],
    "5 to 1000, got": [(external_gripper.Session, {"answer_ms": [4, 1001, 100.0]}, {})],
}
"""For each refusal: what is made, values of an option, and its other options."""

ACCEPTED: list[tuple[Callable[..., Any], dict[str, list[Any]]]] = [
    (bota.Session, {"sinc_length": [64, 2047]}),
    (tsf85.Session, {"period_ms": [1, 255]}),
    (tsf85.Decoder, {"timestamp_unit_ns": [1, None]}),
    (dsacon32.Session, {"rate_hz": [1, 30]}),
    (dsacon32.Decoder, {"matrices": [[[1, 1]] * 16, [[64, 32]]]}),
    (wts.Session, {"interval_ms": [0, 65_535]}),
    (netft.Decoder, {"internal_hz": [0, 1.0, 1e6]}),
    (robotous.Decoder, {"torque_divider": [1, 2000.0]}),
    (pvdf.Decoder, {"rows": [1, 256], "cols": [1, 256]}),
    (gauges.Decoder, {"matrix": [(1e6 * EYE).tolist(), NEARLY_SINGULAR.tolist()], "offset": [[2.0**32] * 6]}),
    (robotiq_2f.Session, {"poll_period_s": [0.005], "unit": [1, 247]}),
    (wsg.Session, {"period_ms": [5, 200]}),
    (external_gripper.Session, {"answer_ms": [5, 1000]}),
]


@pytest.mark.parametrize("words", REFUSED)
def test_an_option_that_no_device_can_have_is_refused(words: str) -> None:
    for make, options, others in REFUSED[words]:
        for name, values in options.items():
            for value in values:
                with pytest.raises(ValueError, match=words):
                    make(**others, **{name: value})


def test_an_option_at_its_limits_is_accepted() -> None:
    for make, options in ACCEPTED:
        for name, values in options.items():
            for value in values:
                assert make(**{name: value}).health.bad == 0
