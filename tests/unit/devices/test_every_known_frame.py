"""Known bytes of each device, and the readings that they stand for.

"published" and "captured" bytes come from a sensor; "worked" ones were computed by hand from the maker's field table.
"""

from __future__ import annotations

from ast import literal_eval
from typing import Any

import pytest
from readings import Case

from slipd.devices import DEVICES

GRASP = {"active": True, "moving": False, "object": "contact_closing", "fault": "", "width_m": None, "echo_ok": None}
CELLS = [0, 0, 0, 0, 100, 250, 0, 0, 0, 0, 7, 0]
FIRST_XELA = (
    b'{"message":1476,"type":"routine","1":{"sensor":"1","model":"uSPa44","taxels":1,"time":.8365479,'
    b'"data":"B8BF,37B0,881E","calibrated":[0.7007,4.3194,-4.4254]}}'
).hex()
"""Built from sample values published with a client; the number without a leading zero is as published."""

NETFT = "00 BC 61 4E FF D9 DA 60 05 D8 E3 20 00 02 49 F0 FF FF 5B F0 00 00 00 07"
KNOWN: dict[str, tuple[str, list[dict[str, Any]]]] = {
    "bota worked": (
        "AA 00 00 00 00 C0 3F 00 00 10 C0 00 00 20 41 "
        "00 00 00 3E 00 00 00 BF 00 00 00 3D 40 E2 01 00 00 00 FC 41 10 C6",
        [
            {
                "force_n": [1.5, -2.25, 10],
                "torque_nm": [0.125, -0.5, 0.03125],
                "device_time_ns": 123_456_000,
                "status": (),
            }
        ],
    ),
    "bota worked overload": (
        "AA 02 00 00 00 16 44 00 00 10 C0 00 00 20 41 "
        "00 00 00 3E 00 00 00 BF 00 00 00 3D 22 E7 01 00 00 00 FC 41 95 65",
        [{"force_n": [600, -2.25, 10], "status": ("overload",)}],
    ),
    "robotous worked": (
        "55 0B 02 69 FF 83 13 29 00 FA FF AC 00 03 08 00 00 E4 AA",
        [
            {
                "force_n": [12.34, -2.5, 98.1],
                "torque_nm": [0.125, -0.042, 0.0015],
                "device_time_ns": None,
                "status": ("overload",),
            }
        ],
    ),
    "robotous torque_divider=1000 worked": (
        "55 0B 02 69 FF 83 13 29 00 FA FF AC 00 03 08 00 00 E4 AA",
        [{"force_n": [12.34, -2.5, 98.1], "torque_nm": [0.25, -0.084, 0.003]}],
    ),
    "optoforce counts_per_n=[26.416666666666668,28.803333333333335,3.0245] published": (
        "AA 07 08 0A 2D 6A 00 00 FF F7 FF FB 00 07 05 51",
        [{"force_n": [-0.340694, -0.173591, 2.314432], "torque_nm": None, "device_time_ns": None, "status": ()}],
    ),
    "optoforce worked": (
        "AA 07 08 10 03 E8 00 80 00 FA FF 83 0B B8 00 28 FF D8 00 07 07 79",
        [{"force_n": [250, -125, 3000], "torque_nm": [40, -40, 7], "status": ("overload",)}],
    ),
    "optoforce counts_per_n=[10,-10,100] counts_per_nm=[40,80,7] worked": (
        "AA 07 08 10 03 E8 00 80 00 FA FF 83 0B B8 00 28 FF D8 00 07 07 79",
        [{"force_n": [25, 12.5, 30], "torque_nm": [1, -0.5, 1]}],
    ),
    'optoforce wiring="udp" worked': (
        "00 00 00 01 00 00 01 F4 00 00 00 00 00 01 E2 40 FF FF 9E 58 00 0E F8 08 00 00 3A 98 FF FF EF 98 00 00 00 03",
        [
            {
                "force_n": [12.3456, -2.5, 98.1],
                "torque_nm": [0.15, -0.042, 0.00003],
                "device_time_ns": 500_000_000,
                "status": (),
            }
        ],
    ),
    "netft worked": (
        f"00 00 00 07 00 01 E2 40 00 00 00 00 {NETFT} 00 00 00 08 00 01 E2 47 80 00 00 05 {NETFT}",
        [
            {
                "force_n": [12.345678, -2.5, 98.1],
                "torque_nm": [0.15, -0.042, 0.000007],
                "device_time_ns": round(123_456 / 7e-6),
                "status": (),
            },
            {
                "device_time_ns": round(123_463 / 7e-6),
                "status": ("temperature", "broken_gauge", "invalid", "error"),
            },
        ],
    ),
    "tsf85 worked": (
        "9A 00 58 56 10 03 E8 03 E9 03 EA 03 EB 03 EC 03 ED 03 EE 03 EF 03 F0 03 F1 03 F2 03 F3 03 F4 03 F5 03 F6 03 F7"
        "03 F8 03 F9 03 FA 03 FB 03 FC 03 FD 03 FE 03 FF 04 00 04 01 04 02 04 03 20 FF 85 30 00 2C 3F 74 02 D8 40 FF 81"
        "00 6F FF 9E 24 00 4D 70 00 00 00 00 00 00 6C 1E",
        [{"values": list(range(1000, 1028)), "device_time_ns": None, "source": "0", "status": ()}],
    ),
    "tsf85 timestamp_unit_ns=1000 worked": (
        f"9A 00 61 4C 50 00 01 00 02 00 03 60 0C E4 70 00 00 00 00 00 00 6C 1F 10 {28 * '01 2C '}"
        "9A 00 59 03 60 0C E4 9A 00 E3 06 31 2E 32 2E 33 00",
        [{"values": 28 * [300], "device_time_ns": 27_679_000}],
    ),
    "dsacon32 worked": (
        "AA AA AA 00 1D 00 E8 03 00 00 00 00 00 00 00 "
        "00 00 00 00 64 00 FA 00 00 00 00 00 00 00 00 00 07 00 00 00 FB 76",
        [{"values": CELLS, "device_time_ns": 1_000_000_000, "source": "0", "status": ()}],
    ),
    "dsacon32 matrices=[[4,2],[2,2]] worked in runs": (
        "AA AA AA 00 11 00 09 04 00 00 01 00 40 64 10 FA 10 00 40 07 10 00 10 67 91",
        [
            {"values": CELLS[:8], "device_time_ns": 1_033_000_000, "source": "0"},
            {"values": CELLS[8:], "device_time_ns": 1_033_000_000, "source": "1"},
        ],
    ),
    "wts worked": (
        "AA AA AA 00 45 00 40 E2 01 00 00 00 00 00 00 00 00 00 00 00 00 0C 00 50 00 00 00 05 00 2C 01 0A 05 28 00 00 00"
        "04 01 FF 07 21 00 00 00 14 00 96 00 09 00" + "00" * 24 + "A5 81",
        [
            {
                "values": [
                    *(0, 0, 0, 0, 0, 12, 80, 0, 5, 300, 1290, 40, 0, 260, 2047, 33, 0, 20, 150, 9),
                    *([0] * 12),
                ],
                "device_time_ns": 123_456_000_000,
                "source": "",
                "status": (),
            }
        ],
    ),
    "wts worked, unsigned time": (
        "AA AA AA 00 45 00 05 00 00 80 00" + "00" * 64 + "BB FF",
        [{"values": [0] * 32, "device_time_ns": ((1 << 31) + 5) * 1_000_000}],
    ),
    "xela published": (
        FIRST_XELA,
        [{"values": [[47295, 14256, 34846]], "source": "1", "device_time_ns": 836_547_900, "dwell_ns": 0}],
    ),
    "xela calibrated=True published": (FIRST_XELA, [{"values": [[0.7007, 4.3194, -4.4254]]}]),
    "robotiq_2f worked grasp": ("09 04 06 B9 00 00 FF BD 00 5C 9A", [GRASP | {"device_time_ns": None}]),
    "robotiq_2f worked opening": (
        "09 04 06 F9 00 00 00 0D 00 17 AA",
        [{"active": True, "moving": False, "object": "none", "current_a": 0.0}],
    ),
    "robotiq_2f worked motion": (
        "09 03 06 39 00 00 FF 0E 0A F7 8B",
        [{"moving": True, "object": "moving", "current_a": 0.1}],
    ),
    "robotiq_2f worked overcurrent": (
        "09 04 06 31 00 0E C8 96 00 EF C4",
        [{"active": True, "moving": False, "object": "none", "fault": "overcurrent"}],
    ),
}
"""Device with its options, and where the bytes come from: the bytes, and what is known of each reading."""

TEMPERATURES_C = {"bota": 31.5}


@pytest.mark.parametrize("name", KNOWN)
def test_known_bytes_give_these_readings(name: str) -> None:
    text, wanted = KNOWN[name]
    device, *options = name.split(" ")
    named = (option.split("=") for option in options if "=" in option)
    options_of = {key: literal_eval(value) for key, value in named}
    Case(bytes.fromhex(text), wanted, {"temperature_c": TEMPERATURES_C.get(device)}, options_of).check(
        DEVICES[device].decoder
    )
