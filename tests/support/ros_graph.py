"""A ROS 2 domain of the test's own, on the loopback interface, and a listener in it that is another process."""

from __future__ import annotations

import contextlib
import json
import os
import random
import select
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.qos import Policy, Qos
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic

from slipd_client.ros.dds import dds_topic_name, encoded_type, ros_environment


class Heard(NamedTuple):
    """What the listener received.

    Attributes:
        topic: ROS topic.
        data: CDR bytes.
        type: Name of the writer's type in DDS.
        user_data: USER_DATA of the writer.
    """

    topic: str
    data: bytes
    type: str
    user_data: bytes


_CLAIMS: list[socket.socket] = []
"""Names that this process holds until it ends; one for each domain that it uses."""


def free_domain() -> dict[str, str]:
    """Return ROS's environment variables for a domain in which nobody is, and which no other test takes meanwhile."""
    while True:
        domain = random.randrange(1, 100)
        claim = socket.socket(socket.AF_UNIX)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as first, contextlib.suppress(OSError):
            claim.bind(f"\0slipd-tests-ros-domain-{domain}")
            first.bind(("127.0.0.1", 7410 + 250 * domain))  # of the first participant
            _CLAIMS.append(claim)
            return {"ROS_DOMAIN_ID": str(domain), "ROS_LOCALHOST_ONLY": "1"}
        claim.close()


@contextlib.contextmanager
def joined(variables: Mapping[str, str]) -> Iterator[DomainParticipant]:
    """Join a domain."""
    environment = ros_environment(variables)
    domain = Domain(environment.domain, environment.configuration)
    participant = DomainParticipant(environment.domain)
    yield participant
    del participant, domain


class Listener(contextlib.AbstractContextManager["Listener"]):
    """A process that subscribes to topics, used in ``with``.

    Args:
        variables: Environment variables that name the domain.
        topics: The type ("package/Name") of each topic.
        latched: Ask for the messages from before, too.
    """

    def __init__(self, variables: Mapping[str, str], topics: Mapping[str, str], *, latched: bool = False) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-m", "ros_graph", json.dumps([topics, latched])],
            env=os.environ | dict(variables) | {"PYTHONPATH": os.pathsep.join(sys.path)},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    def hear(self) -> Heard:
        """Wait for the next message."""
        assert self._process.stdout is not None
        topic, data, kind, user_data = json.loads(self._process.stdout.readline())
        return Heard(topic, bytes.fromhex(data), kind, bytes.fromhex(user_data))

    def stop(self) -> None:
        """Stop reading, as a process that hangs does."""
        self._process.send_signal(signal.SIGSTOP)

    def go_on(self) -> None:
        """Read again."""
        self._process.send_signal(signal.SIGCONT)

    def __exit__(self, *_: object) -> None:
        self._process.kill()
        self._process.communicate()


def reader(participant: DomainParticipant, topic: str, kind: str, *, latched: bool) -> DataReader[Any]:
    """Return a reliable reader of the bytes of a topic."""
    durability = Policy.Durability.TransientLocal if latched else Policy.Durability.Volatile
    qos = Qos(Policy.Reliability.Reliable(0), durability, Policy.History.KeepAll)
    return DataReader(participant, Topic(participant, dds_topic_name(topic), encoded_type(kind)), qos)


def main() -> None:
    """Print every message of the topics in the arguments, until standard input ends."""
    topics, latched = json.loads(sys.argv[1])
    with joined(os.environ) as participant:
        readers = {topic: reader(participant, topic, kind, latched=latched) for topic, kind in topics.items()}
        while not select.select([sys.stdin], [], [], 0.01)[0]:
            for topic, each in readers.items():
                for sample in each.take(100):
                    writer = each.get_matched_publication_data(sample.sample_info.publication_handle)
                    user_data = writer.qos[Policy.Userdata].data
                    print(json.dumps([topic, sample.data.hex(), writer.type_name, user_data.hex()]), flush=True)


if __name__ == "__main__":
    main()
