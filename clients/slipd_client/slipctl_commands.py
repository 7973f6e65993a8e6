"""The commands of ``slipctl``: each sends its requests and prints the replies."""

from __future__ import annotations

import argparse
import contextlib
import importlib
import json

from slipd_client import keys
from slipd_client.errors import CallError, RequestRefused, require
from slipd_client.grip import GripClient
from slipd_client.messages.schema.ops import lease_rule
from slipd_client.messages.schema.replies import Reply

PROGRAMS = {
    "watch": ("", "", "watch"),
    "diagnose": ("", "", "health.bundle"),
    "view": ("websockets", "websockets", "page.view_command"),
    "serve foxglove": ("foxglove", "foxglove-sdk", "viewers.viewers_command"),
    "serve ros2": ("cyclonedds", "cyclonedds", "ros2.ros2_command"),
    "serve fleet": ("zenoh", "eclipse-zenoh", "fleet.robot_bridge"),
    "fleet": ("zenoh", "eclipse-zenoh", "fleet.fleet_command"),
}
"""Commands with connections of their own → module and package of others that each needs, and the module that carries
it out. Each is loaded here: a command loads only what it needs."""


def run(chosen: argparse.Namespace) -> None:
    """Carry out one command and print what it returns.

    Raises:
        ClientError: The daemon refused, or did not answer.
        CallError: An endpoint is wrong, options do not go together, or a package is missing.
        KeyFileError: A key file cannot be used or created.
    """
    command: str = chosen.command
    if command.startswith("keys "):
        keys.run(chosen)
    elif command in PROGRAMS:
        needed, package, name = PROGRAMS[command]
        if needed:
            require(needed, package, f"slipctl {command}")
        importlib.import_module(f"slipd_client.{name}").run(chosen, _keys(chosen))
    else:
        with GripClient(chosen.requests, keys=_keys(chosen)) as client:
            _ask(client, chosen)


def _ask(client: GripClient, chosen: argparse.Namespace) -> None:
    """Carry out a command that sends requests."""
    if chosen.command == "status":
        from slipd_client.watch import print_status

        print_status(client.status(), as_json=chosen.json)
    elif chosen.command == "friction measure":
        from slipd_client import friction_guide

        friction_guide.run(client, chosen, _keys(chosen))
    elif chosen.command == "gravity":
        from slipd_client import gravity_feed

        if (chosen.follow is None) == (not chosen.numbers):
            raise CallError("gravity needs either three or four numbers, or --follow FILE")
        if (reply := gravity_feed.run(client, chosen)) is not None:
            _print_reply(reply, as_json=chosen.json)
    else:
        _request(client, chosen)


def _request(client: GripClient, chosen: argparse.Namespace) -> None:
    """Send the request of a command, with the lease where it needs one or may need one, and print the reply."""
    rule = lease_rule(chosen.op)
    with contextlib.ExitStack() as stack:
        lease = None
        if rule == "holder":
            lease = stack.enter_context(client.lease())
        elif rule == "not_another's" and chosen.op != "tare":
            with contextlib.suppress(RequestRefused):
                stack.enter_context(client.lease())
        method = getattr(client, chosen.op.replace(".", "_"))
        reply = method(**{name: getattr(chosen, name) for name in chosen.fields})
        _print_reply(reply, as_json=chosen.json)
        if lease is not None and (seconds := getattr(chosen, "hold", 0.0)):
            lease.wait(seconds)


def _keys(chosen: argparse.Namespace) -> keys.Keys | None:
    if (chosen.key is None) != (chosen.server_key is None):
        raise CallError("--key (secret key of this client) and --server-key (public key of the daemon) go together")
    return None if chosen.key is None else keys.load(chosen.key, chosen.server_key)


def _print_reply(reply: Reply, *, as_json: bool) -> None:
    if as_json:
        print(json.dumps(reply), flush=True)
        return
    for field, value in reply.items():
        print(f"{field}: {json.dumps(value)}", flush=True)
    if not reply:
        print("done", flush=True)
