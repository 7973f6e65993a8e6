"""The commands of ``slipctl``: each sends its requests and prints the replies."""

from __future__ import annotations

import argparse
import contextlib
import importlib.util
import json
import os
import sys

from slipd_client import keys, keys_command
from slipd_client.errors import CallError, RequestRefused
from slipd_client.grip import GripClient
from slipd_client.messages.schema.replies import Reply
from slipd_client.paths import publish_endpoint, requests_endpoint
from slipd_client.slipctl_parser import PATIENCE_S, SAMPLES


def run(chosen: argparse.Namespace) -> None:
    """Carry out one command and print what it returns.

    Raises:
        ClientError: The daemon refused, or did not answer.
        CallError: An endpoint is wrong, or options do not go together.
        KeyFileError: A key file cannot be used or created.
    """
    command: str = chosen.command
    measures = command == "friction" and chosen.mu_s is None
    if command == "friction" and not measures and (chosen.samples, chosen.patience) != (None, None):
        raise CallError("--samples and --patience are for measuring; with MU_S the friction is set, not measured")
    if command == "commission":
        _commission(chosen)
    elif command.startswith("keys "):
        keys_command.run(chosen)
    elif command == "gravity" and (chosen.follow is None) == (not chosen.numbers):
        raise CallError("gravity needs either three or four numbers, or --follow FILE")
    elif command == "watch":
        from slipd_client.watch import watch  # here: requests need no subscriber

        watch(chosen.publish, keys=_keys(chosen), as_json=chosen.json, once=chosen.once)
    elif command == "viewers":
        from slipd_client.viewers import viewers_command

        viewers_command.run(chosen, _keys(chosen))
    elif command == "ros2":
        _ros2(chosen)
    elif command in ("bridge", "fleet"):
        _fleet(chosen)
    elif command == "relay":
        from slipd_client.viewers.relay import relay

        relay(chosen.publish, chosen.listen, keys=_keys(chosen), time_frame=chosen.time_frame)
    elif command == "view":
        _view(chosen)
    elif command == "diagnose":
        _diagnose(chosen)
    else:
        with GripClient(chosen.requests, keys=_keys(chosen)) as client:
            if command == "status":
                from slipd_client.health.status_command import print_status  # here: requests need no subscriber

                print_status(client.status(), as_json=chosen.json)
            elif command.startswith("grip "):
                _grip(client, chosen)
            elif command == "gravity":
                _gravity(client, chosen)
            elif measures:
                _measure_friction(client, chosen)
            else:
                _print_result(_request(client, chosen))


def _diagnose(chosen: argparse.Namespace) -> None:
    from slipd_client.health.bundle import diagnose  # here: requests need no subscriber

    places = {"publish": chosen.publish, "requests": chosen.requests}
    diagnose(chosen.out, chosen.config, chosen.seconds, keys=_keys(chosen), **places)


def _view(chosen: argparse.Namespace) -> None:
    import asyncio

    try:
        from slipd_client.page.commission_page import CommissionPage
        from slipd_client.page.view_command import view
    except ModuleNotFoundError as error:
        raise CallError("slipctl view needs the package websockets: pip install 'slipd-client[view]'") from error
    named = {"--publish": chosen.publish, "--requests": chosen.requests}
    named |= {"--key": chosen.key, "--server-key": chosen.server_key}
    guide = CommissionPage(chosen.config, [part for each in named.items() if each[1] is not None for part in each])
    options = {"keys": _keys(chosen), "buttons": chosen.buttons, "emulation": chosen.emulation, "commission": guide}
    asyncio.run(view(chosen.publish, chosen.requests, chosen.listen, **options))


def _ros2(chosen: argparse.Namespace) -> None:
    try:
        from slipd_client.ros2 import ros2_command  # here: only this command needs the extra `ros2`
    except ModuleNotFoundError as error:
        raise CallError(
            "slipctl ros2 needs the package cyclonedds: pip install cyclonedds (the extra ros2 of both wheels)"
        ) from error
    ros2_command.run(chosen, _keys(chosen))


def _fleet(chosen: argparse.Namespace) -> None:
    try:
        from slipd_client.fleet import bridge_command, fleet_command  # here: only these commands need the extra `fleet`
    except ModuleNotFoundError as error:
        raise CallError(
            f"slipctl {chosen.command} needs the package eclipse-zenoh: pip install eclipse-zenoh (the extra fleet of "
            "both wheels)"
        ) from error
    if chosen.command == "bridge":
        bridge_command.run(chosen, _keys(chosen))
    else:
        fleet_command.run(chosen)


def _commission(chosen: argparse.Namespace) -> None:
    """Hand over to ``slipd commission``, which reads and writes the config of the daemon."""
    if importlib.util.find_spec("slipd") is None:
        raise CallError("commission changes the config, so it needs the package slipd: run it where the daemon runs")
    sys.stdout.flush()
    defaults = {"publish": publish_endpoint(), "requests": requests_endpoint(), "key": None, "server_key": None}
    given = {name: value for name, default in defaults.items() if (value := getattr(chosen, name)) != default}
    options = [f"--{name.replace('_', '-')}={value}" for name, value in given.items()]
    program = [sys.executable, "-m", "slipd", "commission", *options, *chosen.rest]
    os.execv(sys.executable, program)  # noqa: S606 - our own program


def _gravity(client: GripClient, chosen: argparse.Namespace) -> None:
    from slipd_client import gravity_feed

    if chosen.follow is None:
        vector = gravity_feed.gravity_of(chosen.numbers)
        _print_result(gravity_feed.send(client, chosen.finger, vector, chosen.hold or 0.0))
    elif (reply := gravity_feed.follow(client, chosen.finger, chosen.follow, chosen.hold)) is not None:
        _print_result(reply)


def _measure_friction(client: GripClient, chosen: argparse.Namespace) -> None:
    from slipd_client import friction_guide  # here: requests need no subscriber
    from slipd_client.subscriber import Subscriber

    session = friction_guide.session(
        friction_guide.check(client.status, chosen.finger),
        SAMPLES if chosen.samples is None else chosen.samples,
        PATIENCE_S if chosen.patience is None else chosen.patience,
    )
    with Subscriber(chosen.publish, session.topics, keys=_keys(chosen)) as subscriber:
        friction_guide.measure(session, subscriber)


def _request(client: GripClient, chosen: argparse.Namespace) -> Reply:
    """Return the reply to a command that needs no lease, or not always."""
    command = chosen.command
    if command == "tare take":
        return client.tare(chosen.finger, _stream(chosen), chosen.seconds, unloaded=chosen.unloaded)
    if command == "tare get":
        return client.tare_get(chosen.finger, _stream(chosen))
    if command in ("tare undo", "friction", "object"):
        return _request_with_lease_if_free(client, chosen)
    return client.record_start() if command == "record start" else client.record_stop()


def _stream(chosen: argparse.Namespace) -> str | None:
    """Return the stream of a tare: STREAM after the finger, or ``--stream``, as older scripts name it."""
    stream: str | None = chosen.stream or chosen.named_stream
    return stream


def _request_with_lease_if_free(client: GripClient, chosen: argparse.Namespace) -> Reply:
    """Return the reply to a command that sometimes needs the lease; acquire it unless another client holds it."""
    with contextlib.ExitStack() as stack:
        with contextlib.suppress(RequestRefused):
            stack.enter_context(client.lease())
        if chosen.command == "tare undo":
            return client.tare_undo(chosen.finger, _stream(chosen))
        if chosen.command == "object":
            return client.object_set(chosen.name)
        return client.friction_set(chosen.finger, chosen.mu_s, chosen.mu_d)


def _grip(client: GripClient, chosen: argparse.Namespace) -> None:
    with client.lease() as lease:
        _print_result(_move(client, chosen))
        if seconds := getattr(chosen, "hold", 0.0):
            lease.wait(seconds)


def _move(client: GripClient, chosen: argparse.Namespace) -> Reply:
    """Return the reply to a command that needs the lease."""
    command = chosen.command
    if command == "grip set":
        return client.grip_set(chosen.force_n)
    if command == "grip adjust":
        return client.grip_adjust(chosen.delta_n)
    if command == "grip hold":
        return client.grip_hold()
    if command == "grip close":
        return client.gripper_close(chosen.force_n, chosen.width_m, chosen.speed_mps)
    if command == "grip open":
        return client.gripper_open(drop=chosen.drop, width_m=chosen.width_m, speed_mps=chosen.speed_mps)
    if command == "grip activate":
        return client.gripper_activate(drop=chosen.drop)
    return client.gripper_stop() if command == "grip stop" else client.fault_ack()


def _keys(chosen: argparse.Namespace) -> keys.Keys | None:
    if (chosen.key is None) != (chosen.server_key is None):
        raise CallError("--key (secret key of this client) and --server-key (public key of the daemon) go together")
    return None if chosen.key is None else keys.load(chosen.key, chosen.server_key)


def _print_result(result: Reply) -> None:
    if not result:
        print("done", flush=True)
    for field, value in result.items():
        print(f"{field}: {json.dumps(value)}", flush=True)
