"""Messages and replies: their bodies, and when they are published. No other room knows the keys of the wire; pure."""
