"""One whole exchange with the daemon, without slipd_client: what a client in another language does.

Start it with the endpoint ``requests`` that the daemon prints; docs/clients.md explains it.
"""

import sys
import time

import msgpack
import zmq

if len(sys.argv) != 2:
    sys.exit("usage: exchange.py ENDPOINT, e.g. ipc:///run/slipd/requests")
socket = zmq.Context().socket(zmq.DEALER)
socket.setsockopt(zmq.IMMEDIATE, 1)  # a request is not kept for a daemon that starts later
socket.setsockopt(zmq.SNDTIMEO, 1000)
socket.setsockopt(zmq.LINGER, 0)
socket.connect(sys.argv[1])
number, run, ahead_ns = 0, {}, 0


def ask(op, **fields):
    """Send a request, and return the result of its reply."""
    global number
    number += 1
    deadline = {"deadline_ns": time.monotonic_ns() + ahead_ns + 400_000_000} if run else {}
    try:
        socket.send(msgpack.packb({"v": 1, "id": number, "op": op} | run | deadline | fields))
    except zmq.Again:
        sys.exit(f"{op}: nobody accepts requests at {sys.argv[1]}: is slipd running?")
    while socket.poll(1000):
        reply = msgpack.unpackb(socket.recv())
        if reply["id"] != number:
            continue  # the late reply to an earlier request
        if not reply["ok"]:
            sys.exit(f"{op}: {reply['error']['code']}: {reply['error']['message']}")
        return reply["result"]
    sys.exit(f"{op}: no reply; it may have been carried out")


def hold_the_lease_until(done):
    """Renew the lease until the gripper has come to a state."""
    until_s = time.monotonic() + 10.0
    while not done(ask("status")["gripper"]):
        if time.monotonic() > until_s:
            sys.exit("the gripper did not get there within 10 s")
        ask("lease.renew")
        time.sleep(0.06)  # three renewals within the 200 ms of the lease


hello = ask("hello")
ahead_ns = hello["t_ns"] - time.monotonic_ns()
run = {"boot": hello["boot"]}
ask("lease.acquire", ttl_ms=200)
ask("gripper.activate")
hold_the_lease_until(lambda gripper: gripper["active"])
print(f"closing with {ask('gripper.close', force_n=8.0)['applied_n']:.2f} N")
hold_the_lease_until(lambda gripper: gripper["object"] == "contact_closing")
print(f"raised to {ask('grip.adjust', delta_n=1.0)['applied_n']:.2f} N")
ask("lease.release")
