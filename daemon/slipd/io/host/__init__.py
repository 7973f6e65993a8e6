"""What the daemon needs of its host: systemd, signals, the scheduler and the journal."""
