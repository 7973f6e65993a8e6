"""Commands and what only they use: nothing here runs in the service."""
