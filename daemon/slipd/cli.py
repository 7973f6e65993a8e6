"""``slipd``: run, demo, check, replay, identify, import. Everything heavy is imported by the command that needs it."""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from slipd import __version__
from slipd.errors import ConfigError, SlipdError
from slipd.log_lines import open_log

if TYPE_CHECKING:
    from slipd.config import Config
    from slipd.service import Endpoints

DONE, FAULT, WRONG = 0, 1, 2


def main(argv: list[str] | None = None) -> int:
    """Runs one command and returns its exit code: 0 done, 1 fault at run time, 2 wrong call or config."""
    arguments = _parser().parse_args(argv)
    open_log()
    try:
        return int(arguments.command(arguments))
    except ConfigError as error:
        print(error, file=sys.stderr)
        return WRONG
    except SlipdError as error:
        print(f"slipd: {error}", file=sys.stderr)
        return FAULT
    except KeyboardInterrupt:
        return DONE
    except BrokenPipeError:
        sys.stderr.close()  # the reader of our output is gone, and so is whoever would read of it
        return DONE


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="slipd", description="Warns a robot that its gripper is about to drop something."
    )
    parser.add_argument("--version", action="version", version=f"slipd {__version__}")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")

    run = commands.add_parser("run", help="run the daemon")
    run.add_argument("--config", type=Path, required=True, metavar="FILE")
    run.add_argument("--record", type=Path, metavar="FILE", help="write every event and message to this new file")
    run.set_defaults(command=_run)

    demo = commands.add_parser("demo", help="run the daemon on the virtual gripper")
    demo.add_argument("--seconds", type=_positive, default=None, metavar="N", help="end after N seconds")
    demo.add_argument("--headless", action="store_true", help="show no live view, only the summary")
    demo.add_argument("--seed", type=int, default=0, metavar="N", help="seed of all noise")
    demo.add_argument("--record", type=Path, metavar="FILE", help="write every event and message to this new file")
    demo.set_defaults(command=_demo)

    check = commands.add_parser("check", help="report every fault of a config")
    check.add_argument("file", type=Path, metavar="FILE")
    check.set_defaults(command=_check)

    replay = commands.add_parser("replay", help="run a recording through the same engine")
    replay.add_argument("file", type=Path, metavar="FILE")
    replay.add_argument("--speed", type=_speed, default=1.0, metavar="X|max", help="factor on real time (default 1)")
    replay.add_argument("--json", action="store_true", help="print every message, one per line")
    replay.add_argument("--publish", action="store_true", help="publish the messages on the bus of the recorded config")
    replay.set_defaults(command=_replay)

    identify = commands.add_parser(
        "identify", help="find a finger's mass and centre of mass from a recording of several poses"
    )
    identify.add_argument("file", type=Path, metavar="FILE", help="a recording with gravity.set requests")
    identify.add_argument("--finger", required=True, metavar="NAME")
    identify.set_defaults(command=_identify)

    importer = commands.add_parser("import", help="convert foreign data to a recording")
    formats = importer.add_subparsers(required=True, metavar="FORMAT")
    grips = formats.add_parser("grips", help="a trial folder with xela_sensor1.csv, xela_sensor2.csv, robot_state.csv")
    grips.add_argument("source", type=Path, metavar="SRC")
    grips.add_argument("out", type=Path, metavar="OUT")
    grips.add_argument("--config", type=Path, metavar="FILE", help="the rig (default: the shipped grips.toml)")
    grips.set_defaults(command=_import_grips)
    return parser


def _run(arguments: argparse.Namespace) -> int:
    from slipd import config, service

    rig = config.load(arguments.config)
    return _served(service.serve(rig, record=arguments.record, on_ready=tell_endpoints))


def _demo(arguments: argparse.Namespace) -> int:
    from slipd.demo import run_demo

    return run_demo(arguments.seconds, headless=arguments.headless, seed=arguments.seed, record=arguments.record)


def tell_endpoints(endpoints: Endpoints) -> None:
    """Prints where the daemon serves, for people and for programs that start it."""
    print(f"publish: {endpoints.publish}\nrequests: {endpoints.requests}", flush=True)


def _served(serving: Any) -> int:
    """Runs the daemon; a failure inside its task group comes out as itself."""
    try:
        asyncio.run(serving)
    except BaseExceptionGroup as group:
        first: BaseException = group
        while isinstance(first, BaseExceptionGroup):
            first = first.exceptions[0]
        raise first from group
    return DONE


def _identify(arguments: argparse.Namespace) -> int:
    from slipd.recording.identify_mass import identify_recording, tell

    print(tell(identify_recording(arguments.file, arguments.finger), arguments.finger))
    return DONE


def _check(arguments: argparse.Namespace) -> int:
    from slipd import config
    from slipd.config.hints import hints

    rig = config.load(arguments.file)
    for name, stream in rig.streams().items():
        print(f"{name}: {stream.device} on {stream.port}, {stream.rate_hz:g} Hz")
    for hint in hints(rig):
        print(hint)
    if rig.reflex.enabled:
        print(_reach(rig))
    print(f"{arguments.file}: good, config_id {rig.config_id}")
    return DONE


def _reach(rig: Config) -> str:
    """What the reflex can do in the time that the config says there is."""
    from slipd.gripper.reflex import PERIOD_NS

    reflex, gripper = rig.reflex, rig.gripper
    ceiling_n = reflex.ceiling_n or (gripper.max_force_n if gripper is not None else None) or 0.0
    budget_n = (gripper.budget_n if gripper is not None else None) or ceiling_n
    gain_n = min(reflex.raise_n_per_s * (reflex.lead_time_s + PERIOD_NS * 1e-9), budget_n, ceiling_n)
    return (
        f"reflex: asks for up to {gain_n:.1f} N more within the lead time of {reflex.lead_time_s:g} s,"
        f" up to {ceiling_n:g} N on one pad; the gripper's own time to follow is not in it"
    )


def _replay(arguments: argparse.Namespace) -> int:
    from slipd.recording.reader import open_recording
    from slipd.recording.replay import replay

    recording = open_recording(arguments.file)
    messages = replay(recording, speed=arguments.speed)
    if arguments.publish:
        asyncio.run(_publish(messages, recording.config_text, str(arguments.file), as_json=arguments.json))
    else:
        for topic, body in messages:
            _show(topic, body, as_json=arguments.json)
    if recording.complete:
        return DONE
    lost = f"{recording.lost} entries were lost while recording" if recording.lost else "its end is missing"
    print(f"slipd: this is not the whole run: {recording.fault or f'{arguments.file}: {lost}'}", file=sys.stderr)
    return FAULT


async def _publish(messages: Iterator[tuple[str, dict[str, Any]]], text: str, file: str, *, as_json: bool) -> None:
    """Publishes a replay; the waiting between messages is done beside the loop, which serves subscribers meanwhile."""
    from slipd import config
    from slipd.bus.publisher import Publisher
    from slipd.bus.runtime import RuntimeDirectory
    from slipd_client.messages import encode
    from slipd_client.paths import publish_endpoint, runtime_dir

    endpoint = config.parse(text, file).bus.publish
    with contextlib.ExitStack() as stack:
        if endpoint is None:
            stack.enter_context(RuntimeDirectory(runtime_dir()))
        publisher = stack.enter_context(Publisher(endpoint or publish_endpoint()))
        print(f"publish: {publisher.endpoint}", file=sys.stderr if as_json else sys.stdout, flush=True)
        while (message := await asyncio.to_thread(next, messages, None)) is not None:
            publisher.publish(message[0], encode(message[1]))
            _show(*message, as_json=as_json)


def _show(topic: str, body: dict[str, Any], *, as_json: bool) -> None:
    if as_json:
        print(json.dumps({"topic": topic} | body, ensure_ascii=False, allow_nan=False))
    elif topic == "warning":
        reasons = ", ".join(body["reasons"]) or "none"
        print(f"{body['t_ns'] * 1e-9:12.3f} s  {body['finger']}: {body['previous']} → {body['level']} ({reasons})")


def _import_grips(arguments: argparse.Namespace) -> int:
    from slipd import config
    from slipd.recording.grips import import_trial

    rig = config.load(arguments.config or config.shipped("grips.toml"))
    import_trial(arguments.source, arguments.out, rig.text)
    print(f"{arguments.out}: written; slipd replay {arguments.out} --speed max")
    return DONE


def _positive(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"must be a number, got {text!r}") from None
    if not 0.0 < value < float("inf"):
        raise argparse.ArgumentTypeError(f"must be a positive number, got {text}")
    return value


def _speed(text: str) -> float | None:
    return None if text == "max" else _positive(text)
