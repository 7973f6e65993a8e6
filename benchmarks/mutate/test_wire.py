"""Every number of a decoder is changed once, and no other."""

from __future__ import annotations

from pathlib import Path

from mutate.wire import wire_mutations

SOURCE = """
SYNC, SCALE = b"\\xaa", 50.0
LAYOUT = struct.Struct("<hH")
RATE_HZ = 100
class Decoder:
    def receive(self, data):
        return -scaled(data[2:])
def scaled(data):
    return LAYOUT.unpack(data)[1] / SCALE if data.startswith(SYNC) else int.from_bytes(data, "big")
class Session:
    period_ms = 7
"""


def test_what_leads_to_the_decoder_is_changed_and_nothing_else(tmp_path: Path) -> None:
    file = tmp_path / "device.py"
    file.write_text(SOURCE, encoding="utf-8")
    assert {mutation.text for _, mutation in wire_mutations([file])} == {
        r"b'\xaa' → b'\xab'",
        "50.0 → 62.5",
        "'<hH' → '>hH'",
        "'<hH' → '<Hh'",
        "-scaled(data[2:]) → +scaled(data[2:])",
        "2 → 3",
        "1 → 2",
        "'big' → 'little'",
    }
