"""The commands of ``slipctl``, in the order of the help, and their parser.

Types, ranges and help of the arguments of requests come from the schema of the wire.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from pathlib import Path

from slipd_client.arguments import (
    JSON,
    LISTEN,
    Add,
    Command,
    CommandParser,
    add_commands,
    add_connection,
    argument,
    escaped,
    matching,
    number_in,
    one_of,
)
from slipd_client.friction_session import MOST_SAMPLES
from slipd_client.messages.fields import FLAG, NUMBER, Field
from slipd_client.messages.ops import OPS
from slipd_client.serve_commands import SERVE_COMMANDS

SLIPD = (
    *("run", "demo", "check", "service", "config", "docs", "devices", "info", "replay", "recover", "plot", "identify"),
    *("import", "evaluate", "export", "doctor", "init", "commission", "emulate", "touch"),
)
"""Commands of ``slipd`` alone."""

_METAVARS = {"seconds": "S", "width_m": "M", "speed_mps": "MPS"}
"""Of options; a positional argument has the name of its field."""


def type_of(field: Field) -> Callable[[str], str | float]:
    """Return what turns the text of an argument into a value of a field."""
    return number_in(field.number_range, field.allows) if field.kind is NUMBER else str


def help_of(field: Field) -> str:
    """Return what a field is, with its unit, range and default; plain text without markup."""
    limits = ", ".join(filter(None, (field.unit, field.number_range, field.limit if field.pattern else "")))
    default = f"default: {field.default_text}" if field.default_text and field.kind is not FLAG else ""
    facts = "; ".join(filter(None, (limits, default)))
    meaning = field.meaning.partition("; nil")[0]  # nobody types nil
    return escaped(f"{meaning} ({facts})" if facts else meaning).replace("`", "")


def field_argument(name: str, field: Field) -> Add:
    """Return what adds an argument for a field of an op; required fields and coefficients are positional."""
    if field.kind is FLAG:
        return argument(f"--{name}", action="store_true", help=help_of(field))
    if name == "stream":  # after the finger, as in the client's methods
        return argument(name, metavar="STREAM", choices=field.words, nargs="?", help=help_of(field))
    if field.required or name == "mu_d":
        nargs = None if field.required else "?"
        return argument(name, metavar=name.upper(), type=type_of(field), nargs=nargs, help=help_of(field))
    option, metavar = f"--{name.replace('_', '-')}", _METAVARS[name]
    return argument(option, type=type_of(field), default=field.default, metavar=metavar, help=help_of(field))


def request(name: str, op: str, purpose: str, *fields: str, more: Add | None = None) -> Command:
    """Return the command that sends one request, with an argument for each of these fields of its op."""
    arguments = [field_argument(field, OPS[op].fields[field]) for field in fields]
    arguments += [JSON] if more is None else [more, JSON]
    return Command(name, "slipd_client.slipctl:send_request", purpose, arguments, given={"op": op, "fields": fields})


seconds = type_of(Field("hold", NUMBER, "how long to keep the lease", unit="s", least=0))
"""Type of arguments that are times, s."""

_NAME = OPS["object.set"].fields["name"]
_HOLD = argument(
    "--hold",
    type=seconds,
    default=0.0,
    metavar="S",
    help="keep the lease for S seconds (default: 0); its end moves nothing",
)

COMMANDS = (
    Command(
        "watch",
        "slipd_client.watch:run",
        "show levels, forces and health as they change",
        (
            argument(
                "--topic",
                action="append",
                metavar="TOPIC",
                help="print every message of topics that begin with TOPIC, e.g. wrench.left, as JSON lines; may be "
                "repeated",
            ),
            argument("--json", action="store_true", help="print every message as JSON, one per line"),
            argument("--once", action="store_true", help="show the last messages and exit"),
        ),
    ),
    Command(
        "view",
        "slipd_client.page.view_command:run",
        "show levels, forces, pads and health in a browser; prints the address of the page",
        (
            LISTEN,
            argument(
                "--buttons",
                action=argparse.BooleanOptionalAction,
                help="the page may take tares and change the grip force by 1 N "
                "(default: only if no other machine can open the page)",
            ),
            argument(
                "--config",
                type=Path,
                metavar="FILE",
                help="config that the daemon runs: the page /commission finds how the sensors are mounted, and changes "
                "it",
            ),
            argument(
                "--emulation",
                type=Path,
                metavar="DIR",
                help="folder of a running slipd emulate, whose pads can then be pressed with the mouse",
            ),
        ),
        given={"needs": {"websockets": "websockets"}},
    ),
    *SERVE_COMMANDS,
    Command(
        "status",
        "slipd_client.watch:show_status",
        "show what needs a repair, and the state of the daemon and its streams",
        (JSON,),
    ),
    Command(
        "diagnose",
        "slipd_client.diagnose:run",
        "collect status, messages, log and recordings in one file for support",
        (
            argument(
                "out",
                metavar="OUT",
                nargs="?",
                type=Path,
                default=Path(f"slipd-diagnose-{time.strftime('%Y%m%d-%H%M%S')}.tar.gz"),
                help="new file (default: with the date and time, in this folder)",
            ),
            argument("--config", type=Path, metavar="FILE", help="add this config, without secrets"),
            argument(
                "--seconds", type=seconds, default=5.0, metavar="S", help="how long to listen to messages (default: 5)"
            ),
            JSON,
        ),
    ),
    Command("grip", "", "move the gripper or change its force; acquires the lease"),
    request("grip set", "grip.set", "set the grip force", "force_n", more=_HOLD),
    request("grip adjust", "grip.adjust", "change the grip force", "delta_n", more=_HOLD),
    request("grip hold", "grip.hold", "keep the present grip force, and stop fingers that move"),
    request("grip close", "gripper.close", "close onto an object", "force_n", "width_m", "speed_mps"),
    request("grip open", "gripper.open", "open; refused in contact without --drop", "width_m", "speed_mps", "drop"),
    request("grip activate", "gripper.activate", "make the gripper ready; some open and close fully for it", "drop"),
    request("grip stop", "gripper.stop", "stop the fingers where they are"),
    request("grip ack", "fault.ack", "acknowledge the latched fault"),
    Command("tare", "", "take, show or undo the zero of a finger's sensors: slipctl tare left pad"),
    request(
        "tare take",
        "tare",
        "take the present readings of a finger as zero; nothing may touch it; the word take may be left out",
        *("seconds", "unloaded", "finger", "stream"),
    ),
    request("tare get", "tare.get", "show the tare in use", "finger", "stream"),
    request("tare undo", "tare.undo", "return to the tare before the last one", "finger", "stream"),
    Command("friction", "", "measure the friction between pads and an object by hand, or set it on one finger"),
    Command(
        "friction measure",
        "slipd_client.friction_guide:run",
        "measure friction: pull a gripped object until it slips; moves and sets nothing",
        (
            argument("finger", metavar="FINGER", nargs="?", help="name of the finger (default: all)"),
            argument(
                "--samples",
                type=int,
                choices=range(1, MOST_SAMPLES + 1),
                default=3,
                metavar="N",
                help=f"pulls that must agree, 1 to {MOST_SAMPLES} (default: %(default)s)",
            ),
            argument(
                "--patience",
                type=seconds,
                default=60.0,
                metavar="S",
                help="how long to wait for each pull (default: %(default)g)",
            ),
            JSON,
        ),
    ),
    request(
        "friction set",
        "friction.set",
        "set the friction of one finger; acquires the lease where it can",
        *("finger", "mu_s", "mu_d"),
    ),
    Command(
        "gravity",
        "slipd_client.gravity_feed:run",
        "send the direction of gravity in a pad's frame, so that the finger's weight is known",
        (
            field_argument("finger", OPS["gravity.set"].fields["finger"]),
            JSON,
            argument(
                "numbers",
                type=type_of(Field("number", NUMBER, "a component")),
                nargs="*",
                metavar="NUMBER",
                help="three: gravity in the pad frame, m/s²; four: orientation of the pad in a frame whose Z points "
                "up, quaternion x y z w",
            ),
            argument(
                "--hold",
                type=seconds,
                metavar="S",
                help="repeat each orientation for S seconds (default: 0; followed: 1)",
            ),
            argument(
                "--follow",
                metavar="FILE",
                help='send each new line of a file or pipe ("-": standard input), numbers as above',
            ),
        ),
        "The daemon forgets it after 0.25 s: repeat it with --hold, or follow a file or pipe to which the robot "
        "program writes a line per pose.",
        given={"op": "gravity.set"},
    ),
    Command(
        "object",
        "slipd_client.slipctl:send_request",
        "name the object, so that its friction is remembered; acquires the lease where it can",
        (
            one_of(
                argument(
                    "name",
                    metavar="NAME",
                    nargs="?",
                    type=matching(_NAME.pattern, f"have {_NAME.limit.replace('`', '')}"),
                    help=help_of(_NAME),
                ),
                argument("--none", action="store_true", help="take the name back: another object, or nothing, is held"),
                required=True,
            ),
            JSON,
        ),
        given={"op": "object.set", "fields": ("name",)},
    ),
    Command("record", "", "record what the daemon receives and publishes"),
    request("record start", "record.start", "start a recording; the daemon names the file"),
    request("record stop", "record.stop", "end the recording"),
    Command("keys", "", "create the keys for a daemon across a network"),
    Command(
        "keys new",
        "slipd_client.slipctl:new_keys",
        "create a pair of keys",
        (
            argument("name", metavar="NAME", help="name of the files NAME.key (public) and NAME.key_secret"),
            argument(
                "--dir",
                type=Path,
                metavar="DIRECTORY",
                help="directory of the keys (default: slipd/keys in $XDG_CONFIG_HOME, or in ~/.config)",
            ),
            JSON,
        ),
    ),
)


def parser() -> CommandParser:
    """Return the parser.

    ``command`` of the parsed arguments is the whole command, e.g. "grip set", or "" where it is missing. A command that
    is a single request has its ``op``, and the names of its ``fields`` in the parsed arguments. ``needs`` has the
    module of others that a command imports, and the package that has it.
    """
    top = CommandParser(prog="slipctl", description="Show the state of a running slipd and send it requests.")
    top.add_argument("--version", action="store_true", help="print the version and exit")
    top.set_defaults(command="", needs={})
    top.elsewhere = "slipd", SLIPD
    add_connection(top, None)
    commands = add_commands(top, COMMANDS)
    commands["tare"].default = "take"
    for name, command in commands.items():
        if name.partition(" ")[0] not in ("", "fleet", "keys"):
            add_connection(command, argparse.SUPPRESS)
    return top
