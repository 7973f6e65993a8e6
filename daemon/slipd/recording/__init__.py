"""MCAP recordings: write, read, replay, import."""
