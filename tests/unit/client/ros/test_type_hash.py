"""Our hashes of types are those of ROS 2, by another implementation and by what ROS 2 itself publishes."""

from __future__ import annotations

import pytest
from ros_peers import typestore

from slipd_client.ros.conversion import TYPES
from slipd_client.ros.ros_types import type_hash

STORE = typestore()


@pytest.mark.parametrize("name", sorted(TYPES))
def test_the_hash_of_a_type_is_that_of_rosbags(name: str) -> None:
    assert type_hash(name, TYPES) == STORE.hash_rihs01(TYPES[name].full_name)


def test_the_hash_of_an_imu_is_the_one_that_ros_2_installs_with_it() -> None:
    published = "RIHS01_7d9a00ff131080897a5ec7e26e315954b8eae3353c3f995c55faf71574000b5b"
    assert type_hash("sensor_msgs/Imu", TYPES) == published
