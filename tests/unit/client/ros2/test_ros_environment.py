"""The domain and the reach of discovery, by ROS's environment variables."""

from __future__ import annotations

import xml.etree.ElementTree as ET

import pytest

from slipd_client.errors import CallError
from slipd_client.ros2.ros_environment import ros_environment


def texts(configuration: str, path: str) -> list[str]:
    """Return the text or address of every element at a path in ``<Domain>``."""
    elements = [
        element
        for fragment in configuration.split(",")
        for element in ET.fromstring(fragment).findall(f"Domain/{path}")  # of the test's own configuration
    ]
    return [element.get("address") or element.text or "" for element in elements]


def test_without_variables_dds_is_left_to_its_defaults_in_domain_0() -> None:
    assert ros_environment({}) == (0, "", "")
    assert ros_environment({"ROS_DOMAIN_ID": "", "ROS_STATIC_PEERS": ";"}) == (0, "", "")


def test_the_reach_of_discovery_is_that_of_ros() -> None:
    peers = {"ROS_STATIC_PEERS": "robot; 10.0.0.7;"}
    subnet = ros_environment(peers).configuration
    assert texts(subnet, "Discovery/Peers/Peer") == ["robot", "10.0.0.7"]
    assert texts(subnet, "General/AllowMulticast") == []
    localhost = ros_environment({"ROS_AUTOMATIC_DISCOVERY_RANGE": "localhost"} | peers).configuration
    assert texts(localhost, "Discovery/Peers/Peer") == ["localhost", "robot", "10.0.0.7"]
    assert texts(localhost, "General/AllowMulticast") == ["false"]
    off = ros_environment({"ROS_AUTOMATIC_DISCOVERY_RANGE": "OFF"} | peers).configuration
    assert texts(off, "Discovery/Peers/Peer") == []
    assert texts(off, "Discovery/ParticipantIndex") == ["none"]
    assert ros_environment({"ROS_AUTOMATIC_DISCOVERY_RANGE": "SYSTEM_DEFAULT"} | peers).configuration == ""


def test_localhost_only_is_the_loopback_interface_whatever_the_reach() -> None:
    found = ros_environment({"ROS_LOCALHOST_ONLY": "1", "ROS_STATIC_PEERS": "robot"}).configuration
    assert texts(found, "General/Interfaces/NetworkInterface") == ["127.0.0.1"]
    assert texts(found, "Discovery/Peers/Peer") == ["localhost"]
    assert ros_environment({"ROS_LOCALHOST_ONLY": "0"}).configuration == ""


def test_the_configuration_of_cyclone_dds_comes_last_so_that_it_outranks_ours() -> None:
    own = "file:///etc/cyclonedds.xml"
    assert ros_environment({"CYCLONEDDS_URI": own}).configuration == own
    assert ros_environment({"CYCLONEDDS_URI": own, "ROS_STATIC_PEERS": "a"}).configuration.endswith(f",{own}")


@pytest.mark.parametrize(
    ("variables", "why"),
    [
        ({"ROS_DOMAIN_ID": "233"}, "ROS_DOMAIN_ID must be an integer from 0 to 232, got '233'"),
        ({"ROS_DOMAIN_ID": "-1"}, "got '-1'"),
        ({"ROS_DOMAIN_ID": "ten"}, "got 'ten'"),
        ({"ROS_AUTOMATIC_DISCOVERY_RANGE": "all"}, "must be one of SUBNET, LOCALHOST, OFF, SYSTEM_DEFAULT, got 'ALL'"),
    ],
)
def test_a_value_that_ros_does_not_know_is_refused(variables: dict[str, str], why: str) -> None:
    with pytest.raises(CallError, match=why):
        ros_environment(variables)


def test_a_middleware_without_dds_and_security_are_warned_of() -> None:
    assert "rmw_zenoh_cpp" in ros_environment({"RMW_IMPLEMENTATION": "rmw_zenoh_cpp"}).warning
    assert "SROS" in ros_environment({"ROS_SECURITY_ENABLE": "true"}).warning
    assert ros_environment({"RMW_IMPLEMENTATION": "rmw_cyclonedds_cpp"}).warning == ""
