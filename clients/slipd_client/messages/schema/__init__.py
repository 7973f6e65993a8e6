"""The schema of the wire: every message, request and reply with its fields, each declared once.

``topics`` declares the messages and ``parts`` the maps within them, ``ops`` and ``request_fields`` the requests,
``replies`` their results; ``fields`` and ``kinds`` say what a field is. The daemon's check of requests, the typed
messages and replies, the arguments of ``slipctl`` and the tables of ``docs/protocol.md`` all come from here.
"""
