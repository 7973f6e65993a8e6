"""Events in, messages and commands out: the engine, its links and streams; pure."""
