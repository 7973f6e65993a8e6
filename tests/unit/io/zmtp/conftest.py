"""Peers and waiting times of the tests of ZeroMQ sockets."""

from loop_waits import eventually, loop_faults
from zeromq_peers import clients, context, endpoint, peer

__all__ = ["clients", "context", "endpoint", "eventually", "loop_faults", "peer"]
