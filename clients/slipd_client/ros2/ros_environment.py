"""Where ROS 2 nodes are looked for: the domain and the reach of discovery, by ROS's own environment variables.

They become the same configuration of Cyclone DDS that ``rmw_cyclonedds`` makes of them.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import NamedTuple
from xml.sax.saxutils import quoteattr

from slipd_client.errors import CallError

LARGEST_DOMAIN = 232
"""The ports of a larger one would exceed 65535."""

RANGES = ("SUBNET", "LOCALHOST", "OFF", "SYSTEM_DEFAULT")
_NO_MULTICAST = "<General><AllowMulticast>false</AllowMulticast></General>"
_LOOPBACK = '<General><Interfaces><NetworkInterface address="127.0.0.1"/></Interfaces></General>'


class RosEnvironment(NamedTuple):
    """Domain and configuration.

    Attributes:
        domain: Id of the domain.
        configuration: Fragments of XML, joined by commas, with those of ``CYCLONEDDS_URI`` last; "" for the defaults.
        warning: What will keep nodes from being found; "" where nothing is known.
    """

    domain: int
    configuration: str
    warning: str


def ros_environment(variables: Mapping[str, str], domain: int | None = None) -> RosEnvironment:
    """Return the domain and its configuration.

    Args:
        variables: Environment variables.
        domain: Id of the domain; None: that of ``ROS_DOMAIN_ID``, or 0.

    Raises:
        CallError: A variable has a value that ROS does not know.
    """
    parts = [*_fragments(variables), *filter(None, [variables.get("CYCLONEDDS_URI", "").strip()])]
    if domain is None:
        domain = check_domain(variables.get("ROS_DOMAIN_ID", "").strip() or "0", "ROS_DOMAIN_ID")
    return RosEnvironment(domain, ",".join(parts), _warning(variables))


def check_domain(text: str, name: str) -> int:
    """Return the id of a domain; ``name`` says where it stands.

    Raises:
        CallError: It is no such id.
    """
    if not (text.isascii() and text.isdigit() and int(text) <= LARGEST_DOMAIN):
        raise CallError(f"{name} must be an integer from 0 to {LARGEST_DOMAIN}, got {text!r:.40}")
    return int(text)


def _fragments(variables: Mapping[str, str]) -> Iterator[str]:
    reach = variables.get("ROS_AUTOMATIC_DISCOVERY_RANGE", "").strip().upper() or "SUBNET"
    if reach not in RANGES:
        raise CallError(f"ROS_AUTOMATIC_DISCOVERY_RANGE must be one of {', '.join(RANGES)}, got {reach!r:.40}")
    peers = [peer.strip() for peer in variables.get("ROS_STATIC_PEERS", "").split(";") if peer.strip()]
    if variables.get("ROS_LOCALHOST_ONLY", "").strip() == "1":  # of Humble; it outranks the others in Jazzy
        yield _within_domain(_LOOPBACK)
        yield _within_domain(_NO_MULTICAST + _peers(["localhost"]))
    elif reach == "LOCALHOST":
        yield _within_domain(_NO_MULTICAST + _peers(["localhost", *peers]))
    elif reach == "OFF":
        yield _within_domain(_NO_MULTICAST + "<Discovery><ParticipantIndex>none</ParticipantIndex></Discovery>")
    elif reach == "SUBNET" and peers:
        yield _within_domain(_peers(peers))


def _peers(addresses: Iterable[str]) -> str:
    peers = "".join(f"<Peer address={quoteattr(address)}/>" for address in addresses)
    return (
        "<Discovery><ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>32</MaxAutoParticipantIndex>"
        f"<Peers>{peers}</Peers></Discovery>"
    )


def _within_domain(xml: str) -> str:
    return f"<CycloneDDS><Domain>{xml}</Domain></CycloneDDS>"


def _warning(variables: Mapping[str, str]) -> str:
    middleware = variables.get("RMW_IMPLEMENTATION", "")
    if "zenoh" in middleware:
        return f"RMW_IMPLEMENTATION is {middleware}: its nodes do not speak DDS, and will not see these topics"
    if variables.get("ROS_SECURITY_ENABLE", "").lower() == "true":
        return "ROS_SECURITY_ENABLE is true: slipctl has no keys for SROS 2, and nodes that enforce security ignore it"
    return ""
