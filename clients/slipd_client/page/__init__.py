"""The live view in a browser: a server of one page, and what it shows of a daemon or a recording."""
