import zlib

import msgpack
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slipd.errors import RecordingError
from slipd.events import Bytes, Event, HostNotice, IncidentsChanged, LinkDown, LinkUp, RecordingChanged, Request, Tick
from slipd.recording.event_codec import decode_event, encode_event

TEXT = st.text(st.characters())  # with the surrogates that the system's error texts may hold
NUMBER = st.integers(-(2**63), 2**64 - 1) | st.floats(allow_nan=False, allow_infinity=False)
WORD = st.text(max_size=8)
PLAIN = st.none() | st.booleans() | NUMBER | st.text(max_size=64) | st.binary(max_size=64)
VALUE = PLAIN | st.lists(PLAIN, max_size=5) | st.dictionaries(WORD, PLAIN | st.lists(NUMBER, max_size=5), max_size=5)
COUNT = st.integers(0, 2**63 - 1)
EVENT = st.one_of(
    st.builds(Bytes, TEXT, st.binary()),
    st.builds(LinkUp, TEXT, TEXT),
    st.builds(LinkDown, TEXT, TEXT),
    st.builds(Request, st.binary(), st.dictionaries(WORD, VALUE, max_size=5)),
    st.builds(Tick, COUNT, st.booleans(), COUNT, COUNT),
    st.builds(RecordingChanged, TEXT, TEXT, TEXT, TEXT, COUNT),
    st.builds(HostNotice, TEXT, TEXT),
    st.builds(IncidentsChanged, *[COUNT] * 4, TEXT, TEXT),
)
EXAMPLES: list[Event] = [
    Bytes("left.wrench", b"\x00\xff" * 20),
    LinkUp("left.wrench", "/dev/ttyUSB0"),
    LinkDown("left.wrench", "unplugged"),
    Request(b"\x01client", {"op": "grip.set", "force_n": 2.5, "nested": {"a": [1, None, True]}}),
    Tick(5),
    RecordingChanged("a.mcap", "/state/a.mcap", "failed", "No space left on device", 7),
    IncidentsChanged(2, 1, 0, 300, "/state/a.mcap", "No space left on device"),
    Tick(5, unread=True),
]


@given(n=COUNT, t_ns=COUNT, event=EVENT)
def test_an_event_comes_back_as_it_was(n: int, t_ns: int, event: Event) -> None:
    back = decode_event(encode_event(n, t_ns, event))
    assert back == (n, t_ns, event)
    assert repr(back) == repr((n, t_ns, event))  # 1 == 1.0 == True; their spelling is not


@pytest.mark.parametrize("event", EXAMPLES)
def test_the_payload_is_a_map_that_any_msgpack_reader_can_read(event: Event) -> None:
    whole = msgpack.unpackb(encode_event(3, 7, event))
    assert (whole["n"], whole["t_ns"]) == (3, 7)
    assert [*whole][:3] + [*whole][-1:] == ["n", "t_ns", "kind", "crc32"]


@pytest.mark.parametrize("event", EXAMPLES)
def test_every_flipped_bit_is_noticed(event: Event) -> None:
    payload = encode_event(3, 7, event)
    for place in range(len(payload) * 8):
        damaged = bytearray(payload)
        damaged[place // 8] ^= 1 << place % 8
        with pytest.raises(RecordingError, match="checksum"):
            decode_event(bytes(damaged))


def sealed(body: bytes) -> bytes:
    """A payload with a valid checksum and any content."""
    return body + zlib.crc32(body).to_bytes(4, "big")


def written(**fields: object) -> bytes:
    """A payload as another version or an attacker might write it."""
    return sealed(msgpack.packb({**fields, "crc32": bytes(4)})[:-4])


OLD_TICK = written(n=0, t_ns=7, kind="tick", suspended_ns=5)


def test_events_of_older_recordings_are_read_and_a_tick_is_written_as_before() -> None:
    assert decode_event(OLD_TICK) == (0, 7, Tick(5)), "all lines were read"
    assert encode_event(0, 7, Tick(5)) == OLD_TICK


@given(st.binary(max_size=64))
def test_arbitrary_bytes_raise_only_a_recording_error(data: bytes) -> None:
    for payload in (data, sealed(data)):
        with pytest.raises(RecordingError):
            decode_event(payload)


@pytest.mark.parametrize(
    ("payload", "reason"),
    [
        (written(n=0, t_ns=0, kind="reload"), "must be one of .*, got 'reload'"),
        (written(n=0, t_ns=0, kind=["bytes"]), "kind"),
        (written(n=0, t_ns=0), "got None"),
        (written(n=0, t_ns=0, kind="tick"), "suspended_ns"),
        (written(n=0, t_ns=0, kind="tick", suspended_ns=0, unread=1), "must have the fields"),
        (written(n=0, t_ns=0, kind="tick", suspended_ns=0, more=1), "must have the fields"),
        (written(n=0, t_ns=0, kind="tick", suspended_ns=True), "must have the fields"),
        (written(n=0, t_ns=0.5, kind="tick", suspended_ns=0), "must have the fields"),
        (written(n=0, t_ns=0, kind="bytes", link=b"left", data=b""), "must have the fields"),
        (written(n=0, t_ns=0, kind="request", client=b"", body=[]), "must have the fields"),
        (written(n=0, t_ns=-1, kind="tick", suspended_ns=0), "must be from 0 to"),
        (written(n=0, t_ns=0, kind="tick", suspended_ns=2**63), "must be from 0 to"),
        (written(n=0, t_ns=0, kind="request", client=b"", body={"force_n": float("nan")}), "force_n"),
        (written(n=0, t_ns=0, kind="request", client=b"", body={"a": [0] * 65}), "a recorded request is not valid"),
        (written(n=0, t_ns=0, kind="request", client=b"", body={"a": "a" * 20_000}), "a recorded request is not valid"),
        (written(n=0, t_ns=0, kind="request", client=b"", body={"a": msgpack.ExtType(4, b"")}), "a recorded request"),
        (sealed(msgpack.packb([1, 2, bytes(4)])[:-4]), "must be a map, got list"),
        (sealed(b"\x91" * 5000), "not msgpack"),
        (sealed(b"\xdf\xff\xff\xff\xff"), "not msgpack"),
    ],
)
def test_a_map_with_a_valid_checksum_but_invalid_contents_is_refused(payload: bytes, reason: str) -> None:
    with pytest.raises(RecordingError, match=reason):
        decode_event(payload)
