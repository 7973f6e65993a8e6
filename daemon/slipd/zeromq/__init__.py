"""ZeroMQ sockets within the event loop: bound where only their user reaches them, read without missing a wake-up."""
