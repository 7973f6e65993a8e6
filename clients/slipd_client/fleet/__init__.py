"""``slipctl serve fleet`` and ``slipctl fleet``: the messages of many robots over Zenoh, and the state of all of them.

Only `fleet_network`, `robot_bridge` and `fleet_command` need zenoh, the extra ``fleet``. Nothing here can send a
request to a daemon.
"""
