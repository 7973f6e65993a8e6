"""ZeroMQ: the publisher and the request server."""
