"""ROS messages: bytes, hashes and files as other libraries have them, and every value of recorded runs."""

from __future__ import annotations

import math
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import replays
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.records import Schema
from mcap.well_known import MessageEncoding, SchemaEncoding
from mcap_ros2.decoder import DecoderFactory
from ros_peers import built, plain, typestore
from ros_values import header, time

import slipd_client.ros
from slipd_client.messages.fields import fields_of
from slipd_client.messages.topics import TOPICS
from slipd_client.ros.cdr import CdrEncoder, CdrError
from slipd_client.ros.conversion import TYPES, PadFrames, RosMessage, encode, ros_messages, schema, stamp_ns
from slipd_client.ros.message_package import files, main
from slipd_client.ros.ros_types import RosField, RosType, type_from_text, type_hash
from slipd_client.ros.slipd_types import NAMES

STORE = typestore()
BITS = {"byte": (0, 127), "uint8": (0, 255), "int8": (-128, 127)}  # to rosbags, a byte has a sign
BITS |= {f"int{n}": (-(2 ** (n - 1)), 2 ** (n - 1) - 1) for n in (32, 64)}
BITS |= {f"uint{n}": (0, 2**n - 1) for n in (32, 64)}
TEXTS = st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0"), max_size=9)


def values(field: RosField) -> st.SearchStrategy[Any]:
    kind = field.type
    if kind in TYPES:
        single: st.SearchStrategy[Any] = messages(TYPES[kind])
    elif kind in ("string", "bool"):
        single = TEXTS if kind == "string" else st.booleans()
    else:
        single = st.integers(*BITS[kind]) if kind in BITS else st.floats(width=32 if kind == "float32" else 64)
    if field.length is None:
        return single
    return st.lists(single, min_size=max(field.length, 0), max_size=5 if field.length < 0 else field.length)


def messages(kind: RosType) -> st.SearchStrategy[dict[str, Any]]:
    return st.fixed_dictionaries({field.name: values(field) for field in kind.fields})


@pytest.mark.parametrize("name", sorted(TYPES))
@settings(max_examples=10)
@given(data=st.data())
def test_the_bytes_of_any_message_are_those_of_rosbags(name: str, data: st.DataObject) -> None:
    value = data.draw(messages(TYPES[name]))
    wanted = bytes(STORE.serialize_cdr(built(STORE, name, value), TYPES[name].full_name))
    assert CdrEncoder(name, TYPES).encode(value) == wanted


POINT = type_from_text("t/Point", "string name\nuint8 kind\nfloat64[2] xy\nint64[] counts\nt/Tag[] tags")
TAG = type_from_text("t/Tag", "uint8 OK=0\nbool set")
GOOD: dict[str, Any] = {"name": "a", "kind": 7, "xy": [1.0, math.nan], "counts": [], "tags": [{"set": True}]}
ENCODER = CdrEncoder("t/Point", {"t/Point": POINT, "t/Tag": TAG})


@pytest.mark.parametrize(
    ("change", "error"),
    [
        ({"kind": 256}, "kind: must be uint8: "),
        ({"kind": 1.0}, "kind: must be uint8: "),
        ({"kind": None}, "kind: must be uint8: "),
        ({"name": None}, "name: must be string: "),
        ({"name": "\ud800"}, "name: must be string: "),
        ({"xy": [1.0]}, "xy: must be float64[2]: got 1 entries"),
        ({"counts": None}, "counts: must be int64[]: "),
        ({"counts": [2**63]}, "counts: must be int64[]: "),
        ({"tags": [{}]}, "tags.set: is missing"),
        ({"tags": [{"set": True, "by": "me"}]}, "tags.by: not declared"),
        ({"colour": "red"}, "colour: not declared"),
    ],
)
def test_a_value_that_does_not_fit_is_refused_with_the_path_of_its_field(change: dict[str, Any], error: str) -> None:
    with pytest.raises(CdrError) as refused:
        ENCODER.encode(GOOD | change)
    assert str(refused.value).startswith(f"t/Point: {error}")


@pytest.mark.parametrize(
    ("make", "error", "why"),
    [
        (lambda: CdrEncoder("t/Empty", {"t/Empty": RosType("t/Empty", ())}), ValueError, "t/Empty must have a field"),
        (lambda: CdrEncoder("t/Point", {"t/Point": POINT}), KeyError, "t/Tag"),
        (
            lambda: type_from_text("t/Odd", "int32 x\nfloat64"),
            ValueError,
            "t/Odd: a line must be 'type name' or 'type NAME=value', got 'float64'",
        ),
    ],
)
def test_a_type_without_fields_with_an_undeclared_one_or_with_another_line_is_refused(
    make: Callable[[], object], error: type[Exception], why: str
) -> None:
    with pytest.raises(error, match=why):
        make()


@pytest.mark.parametrize("name", sorted(TYPES))
def test_the_hash_of_a_type_is_that_of_rosbags(name: str) -> None:
    assert type_hash(name, TYPES) == STORE.hash_rihs01(TYPES[name].full_name)


def test_the_hash_of_an_imu_is_the_one_that_ros_2_installs_with_it() -> None:
    assert (
        type_hash("sensor_msgs/Imu", TYPES) == "RIHS01_7d9a00ff131080897a5ec7e26e315954b8eae3353c3f995c55faf71574000b5b"
    )


SHIPPED = Path(slipd_client.ros.__file__).parent / "slipd_msgs"


def test_the_shipped_files_are_those_of_the_types(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """``python -m slipd_client.ros.message_package clients/slipd_client/ros`` writes them."""
    assert main([str(tmp_path)]) == 0
    assert capsys.readouterr().out == f"{tmp_path / 'slipd_msgs'}\n"
    written, shipped = (
        {str(path.relative_to(folder)): path.read_text(encoding="utf-8") for path in folder.rglob("*.*")}
        for folder in (tmp_path / "slipd_msgs", SHIPPED)
    )
    assert written == shipped == files()


def test_the_command_says_why_it_wrote_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "file").touch()
    assert main([str(tmp_path / "file")]) == 1
    assert capsys.readouterr().err == f"{tmp_path / 'file'}: cannot be written: Not a directory\n"
    with pytest.raises(SystemExit):
        main([])


PLACES = {
    "left": {"positions": [[0.0, 0.0, 0.0, 0.0], [0.08, 0.0, 0.04, 0.0]], "quat_xyzw": [1, -1, 1, 1]},
    "right": {"positions": [[0.02, 0, -0.01, 0], [0.08, 0, -0.04, 0]], "quat_xyzw": [-0.5, -0.5, -0.5, 0.5]},
}
PADS = PadFrames(PLACES)


Converted = list[tuple[str, dict[str, Any], RosMessage]]


@pytest.fixture(scope="module")
def published() -> list[tuple[str, dict[str, Any]]]:
    """Topic and body of every message of some runs."""
    return [
        message for name in ("demo", "requests", "papillarray", "reflex") for message in replays.stored_messages(name)
    ]


@pytest.fixture(scope="module")
def converted(published: list[tuple[str, dict[str, Any]]]) -> Converted:
    """Every ROS message, with the topic and body of the message that it was made of."""
    return [(topic, body, each) for topic, body in published for each in ros_messages(topic, body, PADS)]


def same(one: Any, other: Any) -> bool:
    """Return whether two values are the same; NaN is NaN."""
    if isinstance(one, dict):
        return one.keys() == other.keys() and all(same(value, other[key]) for key, value in one.items())
    if isinstance(one, list | tuple):
        return len(one) == len(other) and all(map(same, one, other))
    return one == other or (one != one and other != other)


def test_two_other_libraries_decode_every_value(converted: Converted) -> None:
    for name in {message.type for _, _, message in converted}:
        full_name = TYPES[name].full_name
        text = Schema(id=1, name=full_name, encoding=SchemaEncoding.ROS2, data=schema(name).encode())
        decode = DecoderFactory().decoder_for(MessageEncoding.CDR, text)
        for message in [each for _, _, each in converted if each.type == name][::3]:
            data = encode(message)
            for found in (STORE.deserialize_cdr(data, full_name), decode(data)):
                assert same(plain(found, name), message.value)


UNKNOWN: dict[str, Any] = {"string": "unknown", "int32": -1, "int8": -1}


def in_ros(kind: RosField, wire: Any) -> Any:
    """Return what stands in a ROS message for a value of the wire."""
    if kind.type == "geometry_msgs/Point":
        return [{"x": x, "y": y, "z": 0.0} for x, y in wire or ()]
    if kind.type in ("slipd_msgs/NamedNumber", "slipd_msgs/NamedWords"):
        return [{"name": name, TYPES[kind.type].fields[1].name: each} for name, each in (wire or {}).items()]
    if kind.type in TYPES:
        fields = TYPES[kind.type].fields
        parts = [{each.name: in_ros(each, part.get(each.name)) for each in fields} for part in ([wire] if wire else [])]
        return parts[0] if kind.length is None else parts
    if wire is None:
        single = "" if kind.name == "unknown" else UNKNOWN.get(kind.type, math.nan)
        return single if kind.length is None else [single] * max(kind.length, 0)
    return wire


def test_every_field_of_a_message_of_slipd_is_in_its_ros_message(converted: Converted) -> None:
    for topic, body, (_, name, value) in converted:
        cls = TOPICS[topic.partition(".")[0]]
        if name.partition("/")[2] == NAMES.get(cls):
            types = {field.name: field for field in TYPES[name].fields}
            keys = {field.name for field in fields_of(cls)} - {"v", "timestamp", "frame"}
            times = {key.removesuffix("_ns"): time(body[key]) for key in keys if key.endswith("t_ns")}
            others = {key: in_ros(types[key], body[key]) for key in keys if not key.endswith("t_ns")}
            assert same(value, {"header": header(stamp_ns(body), body["frame"]), **times, **others})


def test_stock_messages_carry_wrench_contact_and_image(converted: Converted) -> None:
    seen = set()
    for topic, body, (name, kind, value) in converted:
        finger = topic.partition(".")[2]
        if kind == "geometry_msgs/WrenchStamped" and body["force_n"] is not None:
            assert name == f"/slipd/{finger}/wrench"
            assert list(value["wrench"]["force"].values()) == body["force_n"]
        elif kind == "geometry_msgs/PointStamped":
            assert name == f"/slipd/{finger}/contact"
            assert same(list(value["point"].values()), [*(body["centroid_m"] or [math.nan] * 2), value["point"]["z"]])
        elif kind == "sensor_msgs/Image":
            pixels = struct.unpack(f"<{body['rows'] * body['cols']}f", value["data"])
            assert (value["height"], value["width"], value["step"]) == (body["rows"], body["cols"], 4 * body["cols"])
            assert same(pixels, body["loads_n"] or [math.nan] * len(pixels)) or pixels == pytest.approx(body["loads_n"])
        seen.add(kind)
    assert len(seen) == 12


def test_diagnostics_carry_the_health_of_every_stream_and_an_unknown_verdict_is_a_warning(converted: Converted) -> None:
    levels = set()
    for topic, body, (name, _, value) in converted:
        if topic == "status":
            shown = {entry["name"].removeprefix("slipd: "): entry["level"] for entry in value["status"]}
            wanted = {stream: state["health"] for stream, state in body["streams"].items()}
            wanted |= {f"finger {key}": int(state["level"] == "unknown") for key, state in body["fingers"].items()}
            assert (name, shown | wanted, len(value["status"])) == ("/diagnostics", shown, len(shown))
            levels |= set(shown.items())
    assert {("grip", 3), ("grip", 0), ("gripper", 2), ("daemon", 0)} <= levels


@pytest.mark.parametrize(
    ("width_m", "places"),
    [(0.04, {"left_pad": 0.02, "right_pad": -0.02}), (0.01, {"left_pad": 0.005}), (0.09, {}), (None, {})],
)
def test_a_pad_has_a_transform_at_a_width_where_its_place_is_known(
    width_m: float | None, places: dict[str, float]
) -> None:
    found = PADS.transforms(header(1_000_000_002, "gripper"), width_m)
    assert {each["child_frame_id"]: each["transform"]["translation"]["y"] for each in found} == pytest.approx(places)
    for each in found:
        assert each["header"] == header(1_000_000_002, "gripper")
        assert sum(part**2 for part in each["transform"]["rotation"].values()) == pytest.approx(1.0)


def test_a_topic_of_a_newer_daemon_has_no_ros_message() -> None:
    assert list(ros_messages("weather", {"timestamp": 1.0})) == []


def test_numbers_of_the_wire_keep_one_type(published: list[tuple[str, dict[str, Any]]]) -> None:
    """Viewers type a field by its first value."""
    types: dict[tuple[str, str], type] = {}

    def check(place: str, key: str, value: Any) -> None:
        if isinstance(value, dict | list):
            for inner, entry in value.items() if isinstance(value, dict) else (("[]", entry) for entry in value):
                check(place, f"{key}.{inner}", entry)
        elif value is not None:
            assert types.setdefault((place, key), type(value)) is type(value), (place, key)

    for topic, body in published:
        check(topic.partition(".")[0], "", body)
