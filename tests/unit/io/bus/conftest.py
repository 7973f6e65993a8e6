"""Peers and waiting times of the tests of ZeroMQ sockets, with a server and subscribers."""

from answering_server import answering, dealer
from heard_topics import subscribe
from loop_waits import eventually, loop_faults
from zeromq_peers import clients, context, endpoint, peer

__all__ = ["answering", "clients", "context", "dealer", "endpoint", "eventually", "loop_faults", "peer", "subscribe"]
