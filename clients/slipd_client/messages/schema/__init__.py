"""The schema of the wire: every message, request and reply with its fields, each declared once.

``topics`` declares the messages (``parts``: the maps within them), ``ops`` the requests, ``replies`` their results;
``fields`` says what a field is. The daemon's check of requests, the typed messages and replies, the arguments of
``slipctl`` and the tables of ``docs/protocol.md`` all come from here.
"""
