"""One file a device: bytes in, samples out, and back; pure."""
