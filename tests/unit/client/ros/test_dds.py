"""What others read of our DDS writers: bytes, types, hashes, the last messages, the speed scale."""

from __future__ import annotations

import itertools
from types import SimpleNamespace
from typing import Any

import pytest
from client_peers import until
from ros_peers import built, typestore

from slipd_client.ros.conversion import TYPES, RosMessage

pytest.importorskip("cyclonedds", reason="needs cyclonedds, the extra `ros2`")

from ros_graph import Heard, Listener, free_domain, joined

from slipd_client.ros.dds import RosPublisher
from slipd_client.ros.motion_advice import SpeedScaling

STORE = typestore()


def sample(kind: str) -> Any:
    """Return a value of a type; sequences have two entries."""
    if kind not in TYPES:
        return "λ 0.7" if kind == "string" else kind == "bool" or 7
    fields = {field.name: (sample(field.type), field.length) for field in TYPES[kind].fields}
    return {
        name: one if count is None else [one] * (2 if count < 0 else count) for name, (one, count) in fields.items()
    }


def expected(message: RosMessage) -> bytes:
    """Return the bytes of another serializer; DDS fills the last four of them up."""
    data = bytes(STORE.serialize_cdr(built(STORE, message.type, message.value), TYPES[message.type].full_name))
    return data + bytes(-len(data) % 4)


def test_who_comes_late_gets_every_type_as_other_serializers_write_it() -> None:
    variables = free_domain()
    topics = {f"/t/{name.replace('/', '_')}": name for name in TYPES}
    with joined(variables) as participant:
        publisher = RosPublisher(participant, dict.fromkeys(topics, 1))
        for topic, name in topics.items():
            publisher.publish(RosMessage(topic, name, sample(name)))
        with Listener(variables, topics, latched=True) as listener:
            heard = {each.topic: each for each in (listener.hear() for _ in topics)}
    for topic, name in topics.items():
        package, _, word = name.partition("/")
        hashed = f"typehash={STORE.hash_rihs01(TYPES[name].full_name)};".encode()
        data = expected(RosMessage(topic, name, sample(name)))
        assert heard[topic] == Heard(topic, data, f"{package}::msg::dds_::{word}_", hashed)


def test_who_comes_late_gets_the_last_warnings_and_of_other_topics_what_comes_after() -> None:
    variables = free_domain()
    topics = dict.fromkeys(("/slipd/warning", "/slipd/grasp"), "builtin_interfaces/Time")
    with joined(variables) as participant:
        publisher = RosPublisher(participant, {"/slipd/warning": 3})

        def publish(second: int) -> None:
            for topic, kind in topics.items():
                publisher.publish(RosMessage(topic, kind, {"sec": second, "nanosec": 0}))

        for second in range(5):
            publish(second)
        with Listener(variables, topics, latched=True) as late, Listener(variables, topics) as listener:
            assert [late.hear().data[4] for _ in range(3)] == [2, 3, 4]
            until(lambda: all(writer.get_matched_subscriptions() for writer in publisher._writers.values()))
            publish(9)
            heard = {each.topic: each.data[4] for each in (listener.hear(), listener.hear())}
            assert heard == dict.fromkeys(topics, 9)


def test_a_reliable_subscriber_that_hangs_delays_nobody_and_gets_the_last_message_afterwards() -> None:
    variables = free_domain()
    with joined(variables) as participant, Listener(variables, {"/t": "sensor_msgs/Image"}, latched=True) as listener:
        publisher = RosPublisher(participant, {"/t": 1})
        image = sample("sensor_msgs/Image") | {"data": bytes(20_000)}

        def publish(count: int) -> None:
            publisher.publish(RosMessage("/t", "sensor_msgs/Image", image | {"width": count}))

        publish(0)
        listener.hear()
        listener.stop()
        for count in range(1, 151):
            publish(count)
        listener.go_on()
        last = expected(RosMessage("/t", "sensor_msgs/Image", image | {"width": 150}))
        until(lambda: listener.hear().data == last)


def test_a_controller_receives_the_scale_and_is_left_with_the_floor() -> None:
    topic, sent, known = "/joint_trajectory_controller/speed_scaling_input", [], {}
    advisor: Any = SimpleNamespace(speed_scale=lambda floor: known.get("scale", floor))
    speed = SpeedScaling(sent.append, topic, advisor, 0.2)
    speed.start()
    until(lambda: sent)
    known["scale"] = 0.7
    until(lambda: sent[-1].value["factor"] == 0.7)
    speed.stop()
    factors = [factor for factor, _ in itertools.groupby(message.value["factor"] for message in sent)]
    kinds = {message[:2] for message in sent}
    assert (factors, kinds) == ([0.2, 0.7, 0.2], {(topic, "control_msgs/SpeedScalingFactor")})
