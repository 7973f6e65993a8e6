"""Argument parser of ``slipctl``; types, ranges and help of what a request carries come from the schema of the wire."""

from __future__ import annotations

import argparse
import os
import re
import time
from collections.abc import Callable
from pathlib import Path

from slipd_client.argument_types import Add, CommandParser, finite
from slipd_client.fleet.fleet_arguments import add_bridge, add_fleet
from slipd_client.friction_samples import MOST_SAMPLES
from slipd_client.listen_address import add_listen
from slipd_client.messages.schema.fields import Field
from slipd_client.messages.schema.kinds import FLAG, NUMBER
from slipd_client.messages.schema.ops import OPS
from slipd_client.paths import publish_endpoint, requests_endpoint
from slipd_client.ros2.ros2_arguments import add_ros2
from slipd_client.viewers.viewers_arguments import add_viewers

SAMPLES = 3
PATIENCE_S = 60.0
"""Of ``slipctl friction`` where nothing else is given."""

_METAVARS = {"seconds": "S", "width_m": "M", "speed_mps": "MPS"}
"""Of options; a positional argument has the name of its field."""


def parser() -> argparse.ArgumentParser:
    """Return the parser.

    ``command`` of the parsed arguments is the whole command, e.g. "grip set", or "" where it is missing. Then
    ``refuse`` prints the commands that there are, and exits with 2.
    """
    top = CommandParser(prog="slipctl", description="Show the state of a running slipd and send it requests.")
    for name, what, default in (
        ("--publish", "endpoint on which slipd publishes", publish_endpoint()),
        ("--requests", "endpoint on which slipd accepts requests", requests_endpoint()),
    ):
        top.add_argument(name, metavar="ENDPOINT", help=f"{what} (default: {_escaped(default)})")
    top.add_argument("--key", metavar="FILE", help="secret key of this client, for a daemon across a network")
    top.add_argument("--server-key", metavar="FILE", help="public key of the daemon")
    add = _commands(top, "")

    watch = add("watch", "show levels, forces and health as they change")
    watch.add_argument("--json", action="store_true", help="print every message, one per line")
    watch.add_argument("--once", action="store_true", help="show the last messages and exit")
    view = add("view", "show the same in a browser, with the pads; prints the address of the page")
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
        help="config that the daemon runs: the page /commission finds how its sensors are mounted, and writes it",
    )
    view.add_argument(
        "--emulation",
        type=Path,
        metavar="DIR",
        help="the folder of a running slipd emulate: its pads can be pressed with the mouse",
    )
    add_viewers(add)
    add_ros2(add)
    add_bridge(add)
    add_fleet(add)
    status = add("status", "show what needs a repair, and the state of the daemon and its streams")
    status.add_argument("--json", action="store_true", help="print the whole reply, and the repairs")
    diagnose = add("diagnose", "collect status, messages, log and recordings in one file for those who help")
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

    _grip(_commands(add("grip", "move the gripper or change its force; acquires the lease"), "grip "))
    _tare(add("tare", "take, show or undo the zero of a finger's sensors: slipctl tare left pad"))
    _friction(add("friction", "measure the friction between pads and an object by hand, or set it on one finger"))

    _gravity(add("gravity", "send the direction of gravity in a pad's frame, so that the finger's weight is known"))

    commission = add(
        "commission", "find mounting, weight and friction, and try a first grasp: the same as slipd commission"
    )
    commission.add_argument("rest", nargs=argparse.REMAINDER, metavar="FILE …", help="see: slipd commission --help")

    named = add("object", "name the object, so that its friction is remembered; acquires the lease where it can")
    choice = named.add_mutually_exclusive_group(required=True)
    choice.add_argument(
        "name", metavar="NAME", nargs="?", type=_object_name, help=_help(OPS["object.set"].fields["name"])
    )
    choice.add_argument("--none", action="store_true", help="take the name back: another object, or nothing, is held")

    record = _commands(add("record", "record what the daemon receives and publishes"), "record ")
    record("start", "start a recording; the daemon names the file")
    record("stop", "end the recording")
    _keys(_commands(add("keys", "manage the keys for a daemon across a network"), "keys "))
    return top


def _grip(add: Add) -> None:
    setting = add("set", "set the grip force")
    _fields(setting, "grip.set", "force_n")
    adjust = add("adjust", "change the grip force")
    _fields(adjust, "grip.adjust", "delta_n")
    for each in (setting, adjust):
        each.add_argument(
            "--hold",
            type=_seconds,
            default=0.0,
            metavar="S",
            help="keep the lease for S seconds (default: 0); its end moves nothing",
        )
    add("hold", "keep the present grip force, and stop fingers that move")
    _fields(add("close", "close onto an object"), "gripper.close", "force_n", "width_m", "speed_mps")
    _fields(add("open", "open; refused in contact without --drop"), "gripper.open", "width_m", "speed_mps", "drop")
    _fields(add("activate", "make the gripper ready; some open and close fully for it"), "gripper.activate", "drop")
    add("stop", "stop the fingers where they are")
    add("ack", "acknowledge the latched fault")


def _friction(friction: argparse.ArgumentParser) -> None:
    friction.description = (
        "Guides through measuring friction: pull an object that is gripped until it slips; nothing moves by itself. "
        "With MU_S the friction of one finger is set instead, with the lease where nobody else holds it."
    )
    _fields(friction, "friction.set", "finger", "mu_s", "mu_d", optional=True)
    friction.add_argument(
        "--samples",
        type=int,
        choices=range(1, MOST_SAMPLES + 1),
        metavar="N",
        help=f"pulls that must agree, 1 to {MOST_SAMPLES} (default: {SAMPLES})",
    )
    friction.add_argument(
        "--patience", type=_seconds, metavar="S", help=f"how long to wait for each pull (default: {PATIENCE_S:g})"
    )


def _gravity(gravity: argparse.ArgumentParser) -> None:
    gravity.description = (
        "Sends gravity in the pad frame, m/s², or the orientation of the pad. The daemon forgets it after 0.25 s: "
        "repeat it with --hold, or follow a file or pipe to which the robot program writes a line per pose."
    )
    _fields(gravity, "gravity.set", "finger")
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


def _tare(tare: CommandParser) -> None:
    add = _commands(tare, "tare ")
    tare.default = "take"
    take = add("take", "take the present readings of a finger as zero; nothing may touch the finger; may be left out")
    _fields(take, "tare", "seconds", "unloaded", "finger", "stream")
    _fields(add("get", "show the tare in use"), "tare.get", "finger", "stream")
    _fields(add("undo", "return to the tare before the last one"), "tare.undo", "finger", "stream")


def _keys(add: Add) -> None:
    new = add("new", "create a pair of keys")
    listed = add("list", "show the public keys in a directory")
    show = add("show", "show one public key, and whether its secret key can be used")
    for each in (new, show):
        each.add_argument("name", metavar="NAME", help="name of the files NAME.key (public) and NAME.key_secret")
    for each in (new, listed, show):
        each.add_argument(
            "--dir",
            type=Path,
            default=keys_directory(),
            metavar="DIRECTORY",
            help="directory of the keys (default: %(default)s)",
        )


def keys_directory() -> Path:
    """Return ``$XDG_CONFIG_HOME/slipd/keys``, or ``~/.config/slipd/keys`` where that is not set."""
    return Path(os.environ.get("XDG_CONFIG_HOME") or "~/.config").expanduser() / "slipd" / "keys"


def _commands(parent: CommandParser, prefix: str) -> Callable[[str, str], CommandParser]:
    group = parent.add_subparsers(title="commands", metavar="COMMAND")
    parent.names = group.choices
    parent.set_defaults(command="", refuse=lambda: parent.error(f"COMMAND must be one of {', '.join(group.choices)}"))

    def add(name: str, what: str) -> CommandParser:
        command = group.add_parser(name, help=what, description=f"{what[0].upper()}{what[1:]}.")
        command.set_defaults(command=prefix + name)
        return command

    return add


def _fields(command: argparse.ArgumentParser, op: str, *names: str, optional: bool = False) -> None:
    """Add an argument for each of these fields of an op; required fields and coefficients are positional.

    Args:
        command: Gets the arguments.
        op: The op.
        names: Names of its fields.
        optional: Every positional argument may be left out.
    """
    for name in names:
        field = OPS[op].fields[name]
        help_text = _help(field)
        if field.kind is FLAG:
            command.add_argument(f"--{name}", action="store_true", help=help_text)
        elif name == "stream":  # after the finger, as in the client's methods
            command.add_argument(name, metavar="STREAM", choices=field.words, nargs="?", help=help_text)
            command.add_argument("--stream", dest="named_stream", choices=field.words, help=argparse.SUPPRESS)
        elif field.required or name.startswith("mu_"):
            nargs = None if field.required and not optional else "?"
            command.add_argument(name, metavar=name.upper(), type=_type(field), nargs=nargs, help=help_text)
        else:
            command.add_argument(
                f"--{name.replace('_', '-')}",
                type=_type(field),
                choices=field.words or None,
                default=field.default,
                metavar=None if field.words else _METAVARS[name],
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
    return _escaped(f"{meaning} ({facts})" if facts else meaning).replace("`", "")


def _escaped(text: str) -> str:
    """Return a text as argparse wants it in a help text."""
    return text.replace("%", "%%")


def _type(field: Field) -> Callable[[str], str | float]:
    """Return what turns the text of an argument into a value of a field."""
    if field.kind is not NUMBER:
        return str

    def number(text: str) -> float:
        value = finite(text)
        if not field.allows(value):
            raise argparse.ArgumentTypeError(f"must be {field.number_range}, got {text}")
        return value

    return number


def _object_name(text: str) -> str:
    field = OPS["object.set"].fields["name"]
    if not re.fullmatch(field.pattern, text):
        raise argparse.ArgumentTypeError(f"must have {field.limit.replace('`', '')}, got {text!r}")
    return text


_seconds = _type(Field("hold", NUMBER, "how long to keep the lease", unit="s", least=0))
