"""The light client of slipd: what a robot's own programs import to hear warnings and ask for grip forces.

Needs Python 3.10, pyzmq and msgpack; imports nothing of the daemon. Each file is imported by its own name
(``from slipd_client.subscriber import Subscriber``), so that a program pays only for what it uses.
"""
