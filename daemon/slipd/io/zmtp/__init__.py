"""The server's side of ZMTP 3.1, the protocol of ZeroMQ, on plain sockets of the event loop (docs/decisions.md, 10)."""
