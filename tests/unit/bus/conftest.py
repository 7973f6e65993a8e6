"""Peers and waiting times of the tests of ZeroMQ sockets."""

from zeromq_peers import clients, context, endpoint, eventually, loop_faults, peer

__all__ = ["clients", "context", "endpoint", "eventually", "loop_faults", "peer"]
