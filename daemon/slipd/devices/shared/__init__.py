"""Parts that several devices share: frame search, checksums, sequence numbers, sessions and state machines."""
