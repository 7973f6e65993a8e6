"""Argument parser of ``slipd``.

What a command cannot do without is a positional argument, and what it writes is the last of them; what it writes
only on demand is ``--out``.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from slipd import __version__
from slipd.tools.cli_arguments import (
    EVERY,
    EXPORTS,
    IMPORTED,
    add_command,
    add_doctor_arguments,
    endpoint,
    export_format,
    page,
    positive,
    rate,
    sentence,
    shard,
    speed,
    table,
    time_s,
)
from slipd_client.arguments import add_listen

_EXIT = "Exit code: 0 done, 1 the answer is no, 2 wrong use, 130 Ctrl-C (slipd docs commands)."


def parser() -> argparse.ArgumentParser:
    """Return the parser; ``command`` of the parsed arguments is the command, e.g. "replay" or "import grips"."""
    top = argparse.ArgumentParser(
        prog="slipd", description="Warn a robot that its gripper is about to drop something.", epilog=_EXIT
    )
    top.add_argument("--version", action="version", version=f"slipd {__version__}")
    top.set_defaults(command="")
    commands = top.add_subparsers(metavar="COMMAND")
    _add_service_commands(commands)
    _add_shipped(commands)
    _add_recordings(commands)
    _add_batches(commands)
    doctor = add_command(commands, "doctor", "read one device, report what is right and wrong, keep a capture of it")
    add_doctor_arguments(doctor)
    _add_init(commands)
    _add_commission(commands)
    _add_emulation(commands)
    return top


def _add_service_commands(commands: Any) -> None:
    run = add_command(commands, "run", "run the daemon")
    _add_rig(run)
    _add_record(run)
    demo = add_command(commands, "demo", "run the daemon on a virtual gripper")
    demo.add_argument(
        "--seconds",
        type=positive,
        metavar="N",
        help="end after N seconds (default: when you press q; without a terminal, at the end of the scene)",
    )
    demo.add_argument(
        "--scene",
        choices=("pour", "carry"),
        default="pour",
        help="what happens: something is poured into a box, or an arm carries a glass that may not be gripped harder, "
        "as fast as slipd advises (default: pour)",
    )
    demo.add_argument("--without-advice", action="store_true", help="of carry: every move at full speed")
    demo.add_argument("--headless", action="store_true", help="print only the summary, without a live view")
    _add_seed(demo)
    _add_record(demo)
    check = add_command(commands, "check", "report every fault in a config", "Exit code 1: it has faults.")
    _add_rig(check)
    _add_json(check)
    service = add_command(commands, "service", "install or uninstall slipd as a systemd service")
    actions = service.add_subparsers(required=True, metavar="install|uninstall|show")
    for name, purpose in (
        ("install", "write the systemd unit that starts this program, and print the next steps"),
        ("uninstall", "remove what install wrote; configs, keys and recordings stay"),
    ):
        action = add_command(actions, f"service {name}", purpose)
        who = action.add_mutually_exclusive_group(required=True)
        who.add_argument("--system", action="store_true", help="for all users; as root")
        who.add_argument("--user", action="store_true", help="for this user, without root")
        action.add_argument("--program", type=Path, metavar="FILE", help="the installed slipd (default: this one)")
        action.add_argument("--root", type=Path, default=Path("/"), metavar="DIR", help="write below DIR, for packages")
    show = add_command(actions, "service show", "list the files for systemd and udev, or print one")
    show.add_argument("name", nargs="?", metavar="NAME", help="name in the list")
    _add_json(show)


def _add_rig(command: argparse.ArgumentParser) -> None:
    """Add the config of the rig, which may also follow ``--config``."""
    rig = command.add_mutually_exclusive_group(required=True)
    rig.add_argument("config", type=Path, nargs="?", action=_Rig, metavar="FILE", help="config of the rig, TOML")
    rig.add_argument("--config", type=Path, metavar="FILE", help="the same, as an option")


class _Rig(argparse.Action):
    """Store the positional FILE; without one, leave that of ``--config``."""

    def __call__(self, _parser: Any, namespace: argparse.Namespace, values: Any, _option: str | None = None) -> None:
        if values is not None:
            setattr(namespace, self.dest, values)


def _add_record(command: argparse.ArgumentParser) -> None:
    command.add_argument("--record", type=Path, metavar="FILE", help="record every event and message to this new file")


def _add_seed(command: argparse.ArgumentParser) -> None:
    command.add_argument("--seed", type=int, default=0, metavar="N", help="seed of the noise (default 0)")


def _add_json(command: Any, what: str = "print one JSON document") -> None:
    command.add_argument("--json", action="store_true", help=what)


def _add_recording(command: argparse.ArgumentParser) -> None:
    command.add_argument("file", type=Path, metavar="RECORDING", help="recording, MCAP")


def _add_shipped(commands: Any) -> None:
    """Add the commands that print what comes with slipd."""
    config = add_command(commands, "config", "list or print the shipped configs")
    configs = config.add_subparsers(required=True, metavar="list|show")
    _add_json(add_command(configs, "config list", "list the shipped configs"))
    show = add_command(configs, "config show", "print a shipped config: slipd config show demo > my_rig.toml")
    show.add_argument("name", metavar="NAME", help="name in the list")
    for command, purpose in (
        ("docs", "list the pages of the documentation, or print one"),
        ("devices", "list the installed devices with their packages, or describe one"),
    ):
        each = add_command(commands, command, purpose)
        each.add_argument("name", nargs="?", metavar="NAME", help="name in the list")
        _add_json(each)


def _add_recordings(commands: Any) -> None:
    """Add the commands that take one recording."""
    info = add_command(
        commands,
        "info",
        "print what a recording holds: length, streams, rates, levels, config, version",
        "Exit code 1: the recording is damaged or cut off; what is there is printed.",
    )
    _add_recording(info)
    _add_json(info)
    replay = add_command(commands, "replay", "run a recording through the engine again")
    _add_recording(replay)
    replay.add_argument(
        "--speed", type=speed, default=1.0, metavar="X|max", help="speed relative to real time (default 1)"
    )
    _add_json(replay, "print every message, one per line")
    replay.add_argument(
        "--publish",
        nargs="?",
        type=endpoint,
        const="",
        metavar="ENDPOINT",
        help="endpoint on which slipd publishes (without ENDPOINT: that of the recorded config)",
    )
    recover = add_command(
        commands,
        "recover",
        "write what is intact of a damaged recording as a complete file",
        "OUT has the index and the summary that other programs need, and states what is missing. Exit code 1: FILE is "
        "not a recording, its start or all of it is damaged, or OUT cannot be written; nothing is written then.",
    )
    _add_recording(recover)
    recover.add_argument("out", type=Path, metavar="OUT", help="new recording, MCAP")
    recover.add_argument(
        "--without-secrets", action="store_true", help="remove passwords, tokens and keys from the config and all texts"
    )
    view = add_command(commands, "view", "show a recording in a browser; prints the address of the page")
    _add_recording(view)
    add_listen(view)
    plot = add_command(
        commands,
        "plot",
        "draw a recording: levels, utilisation, forces, friction, health, pads",
        "What the run itself reported is drawn; with another config the recording is replayed. Its length does not "
        "matter for memory: the least and the largest value of each column of the picture are kept. Only an earlier "
        "plot is replaced. Exit code 1: the recording is damaged or cut off; it is drawn as far as it goes.",
    )
    _add_recording(plot)
    plot.add_argument(
        "--out", type=page, metavar="FILE", help="the page, .html (default: RECORDING.html in this folder)"
    )
    plot.add_argument("--config", type=Path, metavar="FILE", help="replay with this config instead of the recorded one")
    plot.add_argument(
        "--from", dest="begin_s", type=time_s, default=0.0, metavar="S", help="draw from this time on (default 0)"
    )
    plot.add_argument(
        "--to",
        dest="end_s",
        type=positive,
        default=float("inf"),
        metavar="S",
        help="draw up to this time (default: the end)",
    )
    identify = add_command(
        commands, "identify", "find mass and centre of mass of a finger from a recording of several poses"
    )
    identify.add_argument("file", type=Path, metavar="RECORDING", help="recording with gravity.set requests, MCAP")
    identify.add_argument("--finger", required=True, metavar="NAME", help="name of the finger in the config")
    _add_json(identify)
    importer = add_command(commands, "import", "convert other data to a recording")
    formats = importer.add_subparsers(required=True, metavar="FORMAT")
    grips = _add_import(
        formats,
        "grips",
        "import a gripper trial with two XELA pads",
        "folder with xela_sensor1.csv, xela_sensor2.csv and robot_state.csv",
    )
    grips.add_argument(
        "--tare-rows",
        type=int,
        metavar="N",
        help="the fingers are open in the first N rows: take the zero of the pads from them (default: the config's)",
    )
    _add_import(
        formats, "arq", "import an experiment of slip_detection_dataset_2021 (needs h5py)", "HDF5 file of an object"
    )
    _add_import(formats, "papillarray", "import a trial of Incipient-Slip-Detection-PapillArray", "CSV file")
    pushes = _add_import(
        formats,
        "pushes",
        "import measured pushes of an object over a board",
        "ROS 1 bag of MLab_EXP (needs the extra bags), or its compact form, NPZ",
    )
    pushes.add_argument(
        "--mass-kg",
        type=float,
        default=0.15,
        metavar="M",
        help="mass of the object; where it is not known, mu is relative to this (default: %(default)s)",
    )
    pushes.add_argument(
        "--clear-s",
        type=float,
        nargs=2,
        default=(0.0, 0.4),
        metavar=("BEGIN", "END"),
        help="time in which the pusher is clear of the object: the zero of the sensor (default: 0 to 0.4 s)",
    )


def _add_import(formats: Any, name: str, purpose: str, source: str) -> argparse.ArgumentParser:
    """Add the import of one format, with the arguments that all have, and return its parser."""
    command = add_command(formats, f"import {name}", purpose)
    command.add_argument("source", type=Path, metavar="SRC", help=source)
    if name == "arq":
        example = "such as GGCNN2/SpoolSolder/Pose1/Exp1"
        command.add_argument("experiment", metavar="EXPERIMENT", help=example)
    command.add_argument("out", type=Path, metavar="OUT", help="new recording, MCAP")
    command.add_argument("--config", type=Path, metavar="FILE", help=f"config (default: the shipped {IMPORTED[name]})")
    return command


def _add_batches(commands: Any) -> None:
    """Add the commands that take several recordings."""
    evaluate = add_command(
        commands,
        "evaluate",
        "compare what configs would have reported on recordings",
        "The recorded motion stays as it was: a config changes what is reported on it, not what the robot would have "
        "done about that. The zero of a pad stays that of the recording too. Results are kept: what was replayed once "
        "with a config is not replayed again, and an interrupted evaluation goes on. Exit code 1: a config gives other "
        "levels, or a recording is damaged or does not fit a config. docs/batches.md covers large batches.",
    )
    evaluate.add_argument(
        "recordings",
        type=Path,
        nargs="+",
        metavar="RECORDING",
        help="recordings, MCAP; of a folder, all *.mcap in and below it",
    )
    evaluate.add_argument(
        "--config",
        type=Path,
        action="append",
        default=[],
        metavar="FILE",
        help="replay with this config too, beside the recorded one; may be given several times",
    )
    shown = evaluate.add_mutually_exclusive_group()
    shown.add_argument(
        "--out",
        type=table,
        metavar="FILE",
        help="write a Parquet file with one row for each recording and config, and print only its totals",
    )
    _add_json(shown, "print all figures as one JSON list")
    evaluate.add_argument(
        "--shard",
        type=shard,
        default=EVERY,
        metavar="I/N",
        help="take only this share of the recordings, the I-th of N: one for each machine of a cluster",
    )
    evaluate.add_argument(
        "--dask", metavar="ADDRESS", help="replay on the workers of this Dask scheduler, e.g. tcp://10.0.0.5:8786"
    )
    evaluate.add_argument(
        "--results",
        type=Path,
        metavar="FOLDER",
        help="keep all results in this folder, which several machines may share, instead of the newest in the cache",
    )
    export = add_command(
        commands,
        "export",
        "write the messages of a recording as files for other programs",
        "The recording is replayed, so the messages are those of this version of slipd. docs/viewers.md says which "
        "program opens what, docs/recordings.md what a data set for learning holds. Exit code 1: a recording is "
        "damaged, and the export ends there.",
    )
    export.add_argument(
        "recordings",
        type=Path,
        nargs="+",
        metavar="RECORDING",
        help="recording, MCAP; for lerobot also several, or folders of them: each is an episode",
    )
    export.add_argument("out", type=Path, metavar="OUT", help="new folder")
    export.add_argument(
        "--to",
        type=export_format,
        required=True,
        metavar="|".join(EXPORTS),
        help="; ".join(f"{name}: {what}" for name, what in EXPORTS.items()),
    )
    export.add_argument("--rate", type=rate, metavar="HZ", help="frames per second, of lerobot")
    export.add_argument("--task", type=sentence, metavar="TEXT", help="what the robot does, in a sentence, of lerobot")
    export.add_argument("--overwrite", action="store_true", help="replace an earlier export, never anything else")


def _add_init(commands: Any) -> None:
    init = add_command(
        commands,
        "init",
        "find the devices on the serial ports and write a first config for them",
        "Listens at each speed, then asks. Nothing moves: a gripper is asked for its status only. Devices on a network "
        "are not searched. An existing file is never replaced.",
    )
    init.add_argument(
        "file",
        type=Path,
        nargs="?",
        default=Path("slipd.toml"),
        metavar="FILE",
        help="new config (default: slipd.toml)",
    )
    init.add_argument("--list", action="store_true", help="only list the ports and their devices")
    init.add_argument(
        "--ports", type=Path, metavar="DIR", help="folder of the ports (default: /dev/serial/by-id, then other names)"
    )


def _add_commission(commands: Any) -> None:
    commission = add_command(
        commands,
        "commission",
        "find mounting, weight and friction, and try a first grasp",
        "The daemon must run this config. mounting: you press each pad at three places and push it along two "
        "directions. weight: you hold the gripper in four poses. friction: you pull at a gripped sample. grasp: the "
        "gripper closes gently, holds, and opens; it moves only after you agreed (docs/first_day.md). What follows is "
        "written into the config after each step, and the config before is kept as FILE.previous. Exit code 1: "
        "something does not follow, and is not guessed; 130: Ctrl-C.",
    )
    commission.add_argument("file", type=Path, metavar="FILE", help="config of the rig, TOML")
    commission.add_argument(
        "--finger", action="append", default=[], metavar="NAME", help="only this finger; may be given several times"
    )
    commission.add_argument("--publish", metavar="ENDPOINT", help="endpoint on which slipd publishes")
    commission.add_argument("--requests", metavar="ENDPOINT", help="endpoint on which slipd accepts requests")
    commission.add_argument(
        "--patience", type=positive, default=60.0, metavar="S", help="how long to wait for each touch (default 60)"
    )
    commission.add_argument(
        "--from",
        dest="first",
        choices=("mounting", "weight", "friction", "grasp"),
        default="mounting",
        metavar="STEP",
        help="begin with this step: mounting, weight, friction or grasp",
    )
    commission.add_argument(
        "--key", type=Path, metavar="FILE", help="secret key of this client, for a daemon with keys"
    )
    commission.add_argument(
        "--server-key",
        type=Path,
        metavar="FILE",
        help="public key of the daemon (default: that beside the secret key that the config names)",
    )
    commission.add_argument(
        "--dry-run", action="store_true", help="print what would change; change nothing, and move nothing"
    )
    commission.add_argument("--page", action="store_true", help=argparse.SUPPRESS)  # slipctl view --config FILE


def _add_emulation(commands: Any) -> None:
    emulate = add_command(
        commands,
        "emulate",
        "emulate every device of a config, to try slipd without hardware",
        "The sensors are mounted as the config states. A copy of the config with the addresses of the emulated devices "
        "is written; its path is printed last. What is changed in it meanwhile is kept in the working directory. "
        "docs/emulation.md lists the commands. Ctrl-C ends it.",
    )
    emulate.add_argument("file", type=Path, metavar="CONFIG", help="config of a rig, TOML; or name of a shipped one")
    emulate.add_argument(
        "--dir", type=Path, metavar="DIR", help="folder for the lines and the copy (default: a temporary one)"
    )
    emulate.add_argument("--script", type=Path, metavar="FILE", help="carry out the commands of this file first")
    emulate.add_argument(
        "--unkind", action="store_true", help="sensors with clocks, taxels and lines as unkind as those of real ones"
    )
    _add_seed(emulate)
    touch = add_command(commands, "touch", "press, push or twist a pad of a running emulation")
    touch.add_argument("dir", type=Path, metavar="DIR", help="folder of the emulation, which it prints")
    touch.add_argument(
        "words",
        nargs=argparse.REMAINDER,
        metavar="COMMAND",
        help='such as: press left 5 N at 0 0 mm; "help" lists all; without a command, lines of standard input',
    )
