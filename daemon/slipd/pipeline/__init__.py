"""One finger, and the engine that every event passes; pure."""
