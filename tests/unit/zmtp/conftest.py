"""The peers and the patience that all tests of ZeroMQ sockets share."""

from zeromq_peers import clients, context, endpoint, eventually, loop_faults, peer

__all__ = ["clients", "context", "endpoint", "eventually", "loop_faults", "peer"]
