"""Requests of clients: checked, done at most once, and answered; pure."""
