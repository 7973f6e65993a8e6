"""The commands of ``slipd`` with their arguments, in the order of the help, and their parser.

What a command cannot do without is a positional argument, and what it writes is the last of them; what it writes
only on demand is ``--out``.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from slipd import __version__
from slipd.tools.cli_arguments import JSON, positive
from slipd.tools.recording_commands import RECORDING_COMMANDS
from slipd_client.arguments import Command, CommandParser, add_commands, argument, one_of


class _Rig(argparse.Action):
    """Store the positional FILE; without one, leave that of ``--config``."""

    def __call__(self, _parser: Any, namespace: argparse.Namespace, values: Any, _option: str | None = None) -> None:
        if values is not None:
            setattr(namespace, self.dest, values)


RIG = one_of(
    argument("config", type=Path, nargs="?", action=_Rig, metavar="FILE", help="config of the rig, TOML"),
    argument("--config", type=Path, metavar="FILE", help="another way to name the config"),
    required=True,
)
RECORD = argument("--record", type=Path, metavar="FILE", help="record every event and message to this new file")
SEED = argument("--seed", type=int, default=0, metavar="N", help="seed of the noise (default 0)")
NAME = argument("name", metavar="NAME", help="name, as the list shows it")
NAME_OR_ALL = argument("name", nargs="?", metavar="NAME", help="name (default: print the list)")
SERVICE = (
    one_of(
        argument("--system", action="store_true", help="for all users; as root"),
        argument("--user", dest="system", action="store_false", help="for this user, without root"),
        required=True,
    ),
    argument("--program", type=Path, metavar="FILE", help="the installed slipd (default: this one)"),
    argument(
        "--root", type=Path, default=Path("/"), metavar="DIR", help="with --system: write below DIR, to build a package"
    ),
)


COMMANDS = (
    Command("run", "slipd.service:run_command", "run the daemon", (RIG, RECORD)),
    Command(
        "demo",
        "slipd.tools.demo:run_demo",
        "run the daemon on a virtual gripper",
        (
            argument(
                "--seconds",
                type=positive,
                metavar="N",
                help="end after N seconds (default: when you press q; without a terminal, at the end of the scene)",
            ),
            argument(
                "--scene",
                choices=("pour", "carry"),
                default="pour",
                help="pour: a held box is filled until it would turn; carry: an arm carries a glass that may not be "
                "gripped harder, as fast as slipd advises (default: pour)",
            ),
            argument("--without-advice", action="store_true", help="with --scene carry: make every move at full speed"),
            argument("--headless", action="store_true", help="print only the summary, without a live view"),
            SEED,
            RECORD,
        ),
    ),
    Command(
        "check",
        "slipd.tools.check_command:check_command",
        "report every fault in a config",
        (RIG, JSON),
        "Exit code 1: the config has faults.",
    ),
    Command("service", "", "install or uninstall slipd as a systemd service"),
    Command(
        "service install",
        "slipd.tools.service_command:install",
        "write the systemd unit that starts this program, and print the next steps",
        SERVICE,
    ),
    Command(
        "service uninstall",
        "slipd.tools.service_command:uninstall",
        "remove what install wrote; configs, keys and recordings stay",
        SERVICE,
    ),
    Command(
        "service show",
        "slipd.tools.shipped_files:shipped_command",
        "list the files for systemd and udev, or print one",
        (NAME_OR_ALL, JSON),
        given={"kind": "service show"},
    ),
    Command("config", "", "list or print the shipped configs"),
    Command(
        "config list",
        "slipd.tools.shipped_files:shipped_command",
        "list the shipped configs",
        (JSON,),
        given={"kind": "config show"},
    ),
    Command(
        "config show",
        "slipd.tools.shipped_files:shipped_command",
        "print a shipped config: slipd config show demo > my_rig.toml",
        (NAME,),
        given={"kind": "config show"},
    ),
    Command(
        "docs",
        "slipd.tools.shipped_files:shipped_command",
        "list the pages of the documentation, or print one",
        (NAME_OR_ALL, JSON),
        given={"kind": "docs"},
    ),
    Command(
        "devices",
        "slipd.tools.devices_command:print_devices",
        "list the installed devices with their packages, or describe one",
        (NAME_OR_ALL, JSON),
    ),
    *RECORDING_COMMANDS,
    Command(
        "doctor",
        "slipd.tools.discovery.doctor_command:doctor",
        "read one device, report what is right and wrong, and keep a capture of its bytes",
        (
            argument(
                "port",
                metavar="PORT",
                help="serial port or address of the device; or a FILE.capture, to examine it again",
            ),
            argument(
                "--device",
                dest="name",
                metavar="NAME",
                help="name of the device, as slipd devices lists it; not for a capture",
            ),
            argument("--seconds", type=positive, default=10.0, metavar="S", help="how long to read (default 10)"),
            argument("--rate", dest="rate_hz", type=positive, metavar="HZ", help="expected readings/s (default: any)"),
            argument("--baud", type=int, metavar="N", help="line speed, bit/s (default: the device's)"),
            argument(
                "--options", default="", metavar="TOML", help="options of the device, such as 'rows = 8, cols = 16'"
            ),
            argument(
                "--out",
                type=Path,
                default=Path(),
                metavar="DIR",
                help="folder of report and capture (default: this one)",
            ),
        ),
        "Nothing moves: a gripper is only asked for its status. Writes a report and a capture of the bytes, which name "
        "no port, host or user (docs/first_hardware.md). Exit code 1: something is wrong, or the port cannot be "
        "opened.",
    ),
    Command(
        "init",
        "slipd.tools.discovery.config_draft:init_command",
        "find the devices on the serial ports and write a first config for them",
        (
            argument(
                "file",
                type=Path,
                nargs="?",
                default=Path("slipd.toml"),
                metavar="FILE",
                help="new config (default: slipd.toml)",
            ),
            argument("--list", dest="only_list", action="store_true", help="only list the ports and their devices"),
            argument(
                "--ports",
                dest="by_id",
                type=Path,
                metavar="DIR",
                help="folder of the ports (default: /dev/serial/by-id, then other names)",
            ),
        ),
        "Listens at each speed, then asks. Nothing moves: a gripper is asked for its status only. Devices on a network "
        "are not searched. An existing file is never replaced.",
    ),
    Command(
        "commission",
        "slipd.tools.commission.commission_command:commission_command",
        "find mounting, weight and friction, and try a first grasp",
        (
            argument("file", type=Path, metavar="FILE", help="config of the rig, TOML"),
            argument(
                "--finger",
                dest="fingers",
                action="append",
                default=[],
                metavar="NAME",
                help="only this finger; may be given several times",
            ),
            argument("--publish", metavar="ENDPOINT", help="where slipd publishes (default: as the config states)"),
            argument("--requests", metavar="ENDPOINT", help="where it accepts requests (default: likewise)"),
            argument(
                "--patience",
                dest="patience_s",
                type=positive,
                default=60.0,
                metavar="S",
                help="how long to wait for each touch (default 60)",
            ),
            argument(
                "--from",
                dest="first",
                choices=("mounting", "weight", "friction", "grasp"),
                default="mounting",
                metavar="STEP",
                help="begin with this step: mounting, weight, friction or grasp",
            ),
            argument("--key", type=Path, metavar="FILE", help="secret key of this client, for a daemon with keys"),
            argument(
                "--server-key",
                type=Path,
                metavar="FILE",
                help="public key of the daemon (default: that beside the secret key that the config names)",
            ),
            argument("--dry-run", action="store_true", help="only print what would change; the gripper does not move"),
            argument("--page", action="store_true", help=argparse.SUPPRESS),  # slipctl view --config FILE
        ),
        "The daemon must run this config. mounting: you press each pad at three places and push it along two "
        "directions. weight: you hold the gripper in four poses. friction: you pull at a gripped sample. grasp: the "
        "gripper closes gently, holds, and opens; it moves only after you agreed (docs/first_day.md). What a step "
        "finds is written into the config, and the config before is kept as FILE.previous. Exit code 1: something "
        "was not found; nothing is guessed.",
    ),
    Command(
        "emulate",
        "slipd.tools.sim.emulate_command:emulate_command",
        "emulate every device of a config, to try slipd without hardware",
        (
            argument("file", type=Path, metavar="CONFIG", help="config of a rig, TOML; or name of a shipped one"),
            argument(
                "--dir",
                dest="folder",
                type=Path,
                metavar="DIR",
                help="folder for ports and copy (default: a temporary one)",
            ),
            argument(
                "--unkind", action="store_true", help="give the sensors the clocks, taxels and lines of real ones"
            ),
            SEED,
        ),
        "The sensors are mounted as the config states. Run the daemon with the copy of the config whose path is "
        "printed last: it has the addresses of the emulated devices. If you change it, it is kept at the end, under "
        "another name. docs/emulation.md lists the commands. Ctrl-C ends it.",
    ),
    Command(
        "touch",
        "slipd.tools.sim.hand_commands:touch_command",
        "press, push or twist a pad of a running emulation",
        (
            argument("folder", type=Path, metavar="DIR", help="folder of the emulation (its --dir)"),
            argument(
                "words",
                nargs=argparse.REMAINDER,
                metavar="COMMAND",
                help='such as: press left 5 N at 0 0 mm; "help" lists all (default: read commands from standard input)',
            ),
        ),
    ),
)

EXIT = "Exit code: 0 done, 1 the answer is no, 2 wrong use, 130 Ctrl-C (slipd docs commands)."


SLIPCTL = (
    *("watch", "status", "diagnose", "grip", "tare", "friction", "gravity", "object", "record", "keys"),
    *("fleet", "serve"),
)
"""Commands of ``slipctl`` alone."""


def parser() -> CommandParser:
    """Return the parser; ``command`` of the parsed arguments is the command, e.g. "replay" or "import grips"."""
    top = CommandParser(
        prog="slipd", description="Warn a robot that its gripper is about to drop something.", epilog=EXIT
    )
    top.add_argument("--version", action="version", version=f"slipd {__version__}", help="print the version and exit")
    top.set_defaults(command="", run="slipd.cli:first_steps")
    top.elsewhere = "slipctl", SLIPCTL
    add_commands(top, COMMANDS)
    return top
