"""The light client of slipd: what a robot's own programs import to receive warnings and request grip forces.

Needs Python 3.10, pyzmq and msgpack; imports nothing of the daemon. Import each module by its own name, so that a
program loads only what it uses: `slipd_client.subscriber.Subscriber` receives messages, `slipd_client.grip.GripClient`
sends requests, and `slipd_client.aio` has both for asyncio. `slipd_client.messages.typed` has the classes of all
messages and replies, `slipd_client.errors` every exception.
"""
