"""Commands that take a recording: what it holds, what is left of it, what it looks like, and other data made one."""
