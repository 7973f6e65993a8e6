"""Messages: what each topic carries, and how often. The only room that knows the keys of the wire; pure."""
