"""The light client of slipd: what a robot's own programs import to hear warnings and ask for grip forces.

Needs Python 3.10, pyzmq and msgpack; imports nothing of the daemon. Each file is imported by its own name, so that a
program pays only for what it uses: `slipd_client.subscriber.Subscriber` hears, `slipd_client.grip.GripClient` asks, and
`slipd_client.aio` has both for asyncio.
"""
