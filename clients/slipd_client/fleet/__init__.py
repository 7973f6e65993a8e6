"""``slipctl serve fleet`` and ``slipctl fleet``: the messages of many robots over Zenoh, and the state of all of them.

Only `zenoh_session`, `bridge_publisher` and `fleet_listener` import zenoh, the extra ``fleet``. Nothing here can send a
request to a daemon.
"""
