"""One finger: its force and image channels, the contact estimate, and the verdict on every force reading; pure."""
