"""Argument parser of ``slipctl``; types, ranges and help of what a request carries come from the schema of the wire."""

from __future__ import annotations

import argparse
import os
import time
from collections.abc import Callable
from pathlib import Path

from slipd_client.arguments import (
    Add,
    CommandParser,
    add_connection,
    add_json,
    add_listen,
    escaped,
    matching,
    number_in,
)
from slipd_client.friction_session import MOST_SAMPLES
from slipd_client.messages.fields import FLAG, NUMBER, Field
from slipd_client.messages.ops import OPS
from slipd_client.serve_arguments import add_fleet, add_serve

SAMPLES = 3
PATIENCE_S = 60.0
"""Of ``slipctl friction measure`` where nothing else is given."""

_METAVARS = {"seconds": "S", "width_m": "M", "speed_mps": "MPS"}
"""Of options; a positional argument has the name of its field."""

SLIPD = (
    *("run", "demo", "check", "service", "config", "docs", "devices", "info", "replay", "recover", "plot", "identify"),
    *("import", "evaluate", "export", "doctor", "init", "emulate", "touch"),
)
"""Commands of ``slipd`` alone, to which ``slipctl`` points those who mistake one for the other."""

_NOW = {
    **{name: f"{name} is a command of slipd: slipd {name}" for name in SLIPD},
    "viewers": "slipctl viewers is now: slipctl serve foxglove",
    "relay": "slipctl relay is gone; PlotJuggler's source Foxglove Bridge gets the messages of: slipctl serve foxglove",
    "ros2": "slipctl ros2 is now: slipctl serve ros2",
    "bridge": "slipctl bridge is now: slipctl serve fleet",
    "commission": "slipctl commission is now: slipd commission FILE",
}
"""Commands of ``slipd`` and of earlier versions, and what to type instead."""

REQUESTS: dict[str, tuple[str, str, tuple[str, ...]]] = {
    "grip set": ("set the grip force", "grip.set", ("force_n",)),
    "grip adjust": ("change the grip force", "grip.adjust", ("delta_n",)),
    "grip hold": ("keep the present grip force, and stop fingers that move", "grip.hold", ()),
    "grip close": ("close onto an object", "gripper.close", ("force_n", "width_m", "speed_mps")),
    "grip open": ("open; refused in contact without --drop", "gripper.open", ("width_m", "speed_mps", "drop")),
    "grip activate": ("make the gripper ready; some open and close fully for it", "gripper.activate", ("drop",)),
    "grip stop": ("stop the fingers where they are", "gripper.stop", ()),
    "grip ack": ("acknowledge the latched fault", "fault.ack", ()),
    "tare take": (
        "take the present readings of a finger as zero; nothing may touch it; the word take may be left out",
        "tare",
        ("seconds", "unloaded", "finger", "stream"),
    ),
    "tare get": ("show the tare in use", "tare.get", ("finger", "stream")),
    "tare undo": ("return to the tare before the last one", "tare.undo", ("finger", "stream")),
    "friction set": (
        "set the friction of one finger; acquires the lease where it can",
        "friction.set",
        ("finger", "mu_s", "mu_d"),
    ),
    "gravity": (
        "send the direction of gravity in a pad's frame, so that the finger's weight is known",
        "gravity.set",
        ("finger",),
    ),
    "object": (
        "name the object, so that its friction is remembered; acquires the lease where it can",
        "object.set",
        (),
    ),
    "record start": ("start a recording; the daemon names the file", "record.start", ()),
    "record stop": ("end the recording", "record.stop", ()),
}
"""Commands that are one request each → what it does, its op, and the fields that are arguments."""


def parser() -> argparse.ArgumentParser:
    """Return the parser.

    ``command`` of the parsed arguments is the whole command, e.g. "grip set", or "" where it is missing. Then
    ``refuse`` prints the commands that there are, and exits with 2. A command that is a single request has its ``op``,
    and the names of its ``fields`` in the parsed arguments.
    """
    top = CommandParser(prog="slipctl", description="Show the state of a running slipd and send it requests.")
    top.add_argument("--version", action="store_true", help="print the version and exit")
    add_connection(top, None)
    add = _commands(top, "")

    watch = add("watch", "show levels, forces and health as they change")
    watch.add_argument(
        "--topic",
        action="append",
        metavar="TOPIC",
        help="print every message of topics that begin with TOPIC, e.g. wrench.left, as JSON lines; may be repeated",
    )
    watch.add_argument("--json", action="store_true", help="print every message as JSON, one per line")
    watch.add_argument("--once", action="store_true", help="show the last messages and exit")
    view = add("view", "show levels, forces, pads and health in a browser; prints the address of the page")
    add_listen(view)
    view.add_argument(
        "--buttons",
        action=argparse.BooleanOptionalAction,
        help="the page may take tares and change the grip force by 1 N "
        "(default: only if no other machine can open the page)",
    )
    view.add_argument(
        "--config",
        type=Path,
        metavar="FILE",
        help="config that the daemon runs: the page /commission finds how the sensors are mounted, and changes it",
    )
    view.add_argument(
        "--emulation",
        type=Path,
        metavar="DIR",
        help="folder of a running slipd emulate, whose pads can then be pressed with the mouse",
    )
    add_serve(_commands(add("serve", "serve live messages to other programs, until Ctrl-C"), "serve "))
    add_fleet(add("fleet", "show level, health and age of every robot of a fleet (docs/fleet.md)"))
    add_json(add("status", "show what needs a repair, and the state of the daemon and its streams"))
    diagnose = add("diagnose", "collect status, messages, log and recordings in one file for support")
    diagnose.add_argument(
        "out",
        metavar="OUT",
        nargs="?",
        type=Path,
        default=Path(f"slipd-diagnose-{time.strftime('%Y%m%d-%H%M%S')}.tar.gz"),
        help="new file (default: with the date and time, in this folder)",
    )
    diagnose.add_argument("--config", type=Path, metavar="FILE", help="add this config, without secrets")
    diagnose.add_argument(
        "--seconds", type=_seconds, default=5.0, metavar="S", help="how long to listen to messages (default: 5)"
    )
    add_json(diagnose)

    grip = _commands(add("grip", "move the gripper or change its force; acquires the lease"), "grip ")
    requests = _requests(grip, "grip ")
    for name in ("grip set", "grip adjust"):
        requests[name].add_argument(
            "--hold",
            type=_seconds,
            default=0.0,
            metavar="S",
            help="keep the lease for S seconds (default: 0); its end moves nothing",
        )
    tare = add("tare", "take, show or undo the zero of a finger's sensors: slipctl tare left pad")
    tare.default = "take"
    _requests(_commands(tare, "tare "), "tare ")
    _friction(add("friction", "measure the friction between pads and an object by hand, or set it on one finger"))
    _gravity(_requests(add, "gravity")["gravity"])
    named = _requests(add, "object")["object"]
    choice = named.add_mutually_exclusive_group(required=True)
    field = OPS["object.set"].fields["name"]
    rule = matching(field.pattern, f"have {field.limit.replace('`', '')}")
    choice.add_argument("name", metavar="NAME", nargs="?", type=rule, help=_help(field))
    named.set_defaults(fields=("name",))
    choice.add_argument("--none", action="store_true", help="take the name back: another object, or nothing, is held")
    _requests(_commands(add("record", "record what the daemon receives and publishes"), "record "), "record ")
    _keys(_commands(add("keys", "create the keys for a daemon across a network"), "keys "))
    return top


def _requests(add: Add, prefix: str) -> dict[str, argparse.ArgumentParser]:
    """Add the commands of `REQUESTS` that begin so, with arguments for their fields, and ``--json``; return them."""
    added = {}
    for name, (what, op, fields) in REQUESTS.items():
        if name.startswith(prefix):
            added[name] = add(name.removeprefix(prefix) or name, what)
            _fields(added[name], op, *fields)
            added[name].set_defaults(op=op, fields=fields)
            add_json(added[name])
    return added


def _friction(friction: CommandParser) -> None:
    add = _commands(friction, "friction ")
    friction.now = (
        "slipctl friction is now: slipctl friction measure [FINGER], or slipctl friction set FINGER MU_S [MU_D]"
    )
    measure = add("measure", "measure friction: pull a gripped object until it slips; moves and sets nothing")
    measure.add_argument("finger", metavar="FINGER", nargs="?", help="name of the finger (default: all)")
    measure.add_argument(
        "--samples",
        type=int,
        choices=range(1, MOST_SAMPLES + 1),
        default=SAMPLES,
        metavar="N",
        help=f"pulls that must agree, 1 to {MOST_SAMPLES} (default: %(default)s)",
    )
    measure.add_argument(
        "--patience",
        type=_seconds,
        default=PATIENCE_S,
        metavar="S",
        help="how long to wait for each pull (default: %(default)g)",
    )
    add_json(measure)
    _requests(add, "friction ")


def _gravity(gravity: argparse.ArgumentParser) -> None:
    gravity.description = (
        "Sends gravity in the pad frame, m/s², or the orientation of the pad. The daemon forgets it after 0.25 s: "
        "repeat it with --hold, or follow a file or pipe to which the robot program writes a line per pose."
    )
    gravity.add_argument(
        "numbers",
        type=_type(Field("number", NUMBER, "a component")),
        nargs="*",
        metavar="NUMBER",
        help="three: gravity in the pad frame, m/s²; four: orientation of the pad in a frame whose Z points up, "
        "quaternion x y z w",
    )
    gravity.add_argument(
        "--hold", type=_seconds, metavar="S", help="repeat each orientation for S seconds (default: 0; followed: 1)"
    )
    gravity.add_argument(
        "--follow", metavar="FILE", help='send each new line of a file or pipe ("-": standard input), numbers as above'
    )


def _keys(add: Add) -> None:
    new = add("new", "create a pair of keys")
    new.add_argument("name", metavar="NAME", help="name of the files NAME.key (public) and NAME.key_secret")
    new.add_argument(
        "--dir",
        type=Path,
        default=keys_directory(),
        metavar="DIRECTORY",
        help="directory of the keys (default: %(default)s)",
    )
    add_json(new)


def keys_directory() -> Path:
    """Return ``$XDG_CONFIG_HOME/slipd/keys``, or ``~/.config/slipd/keys`` where that is not set."""
    return Path(os.environ.get("XDG_CONFIG_HOME") or "~/.config").expanduser() / "slipd" / "keys"


def _commands(parent: CommandParser, prefix: str) -> Callable[[str, str], CommandParser]:
    group = parent.add_subparsers(title="commands", metavar="COMMAND")
    shown: list[str] = []
    parent.names, parent.shown = group.choices, shown
    for name, now in _NOW.items() if not prefix else ():
        group.add_parser(name).now = now
    parent.set_defaults(command="", refuse=parent.refuse)

    def add(name: str, what: str) -> CommandParser:
        shown.append(name)
        command = group.add_parser(name, help=what, description=f"{what[0].upper()}{what[1:]}.")
        command.set_defaults(command=prefix + name)
        if name not in ("fleet", "keys"):
            add_connection(command, argparse.SUPPRESS)
        return command

    return add


def _fields(command: argparse.ArgumentParser, op: str, *names: str) -> None:
    """Add an argument for each of these fields of an op; required fields and coefficients are positional."""
    for name in names:
        field = OPS[op].fields[name]
        help_text = _help(field)
        if field.kind is FLAG:
            command.add_argument(f"--{name}", action="store_true", help=help_text)
        elif name == "stream":  # after the finger, as in the client's methods
            command.add_argument(name, metavar="STREAM", choices=field.words, nargs="?", help=help_text)
        elif field.required or name == "mu_d":
            nargs = None if field.required else "?"
            command.add_argument(name, metavar=name.upper(), type=_type(field), nargs=nargs, help=help_text)
        else:
            command.add_argument(
                f"--{name.replace('_', '-')}",
                type=_type(field),
                default=field.default,
                metavar=_METAVARS[name],
                help=help_text,
            )


def _help(field: Field) -> str:
    """Return what a field is, with its unit, range and default; plain text without markup."""
    default = field.default_text if field.kind is not FLAG else ""
    facts = "; ".join(
        part
        for part in (
            ", ".join(part for part in (field.unit, field.number_range, field.limit if field.pattern else "") if part),
            f"default: {default}" if default else "",
        )
        if part
    )
    meaning = field.meaning.partition("; nil")[0]  # nobody types nil
    return escaped(f"{meaning} ({facts})" if facts else meaning).replace("`", "")


def _type(field: Field) -> Callable[[str], str | float]:
    """Return what turns the text of an argument into a value of a field."""
    return number_in(field.number_range, field.allows) if field.kind is NUMBER else str


_seconds = _type(Field("hold", NUMBER, "how long to keep the lease", unit="s", least=0))
