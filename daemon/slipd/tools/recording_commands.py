"""The commands of ``slipd`` that take recordings or make them; see `slipd.tools.cli_commands`."""

from __future__ import annotations

from pathlib import Path

from slipd.tools.cli_arguments import (
    EVERY,
    EXPORTS,
    JSON,
    endpoint,
    file_in,
    positive,
    rate,
    sentence,
    shard,
    speed,
    time_s,
)
from slipd_client.arguments import LISTEN, Add, Command, argument, one_of

RECORDING = argument("path", type=Path, metavar="RECORDING", help="recording, MCAP")
NEW_RECORDING = argument("out", type=Path, metavar="OUT", help="new recording, MCAP")


def _import(form: str, importer: str, purpose: str, source: str, *arguments: Add, shipped: str) -> Command:
    """Return a command that imports data; ``arguments`` are those of this format alone."""
    config = argument(
        "--config", dest="config_file", type=Path, metavar="FILE", help=f"config (default: the shipped {shipped})"
    )
    return Command(
        f"import {form}",
        "slipd.tools.recordings.imported_run:import_command",
        purpose,
        (argument("source", type=Path, metavar="SRC", help=source), *arguments, NEW_RECORDING, config),
        given={"importer": f"slipd.tools.recordings.{importer}", "shipped": shipped},
    )


RECORDING_COMMANDS = (
    Command(
        "info",
        "slipd.tools.recordings.info:info_command",
        "print what a recording holds: length, streams, rates, levels, config, version",
        (RECORDING, JSON),
        "Exit code 1: the recording is damaged or cut off; what can be read is printed.",
    ),
    Command(
        "replay",
        "slipd.tools.recordings.replay_commands:replay_command",
        "run a recording through the engine again, and print the changes of level",
        (
            RECORDING,
            argument(
                "--speed", type=speed, default=1.0, metavar="X|max", help="speed relative to real time (default 1)"
            ),
            argument(
                "--json", dest="as_json", action="store_true", help="print every message, as one JSON object a line"
            ),
            argument(
                "--publish",
                nargs="?",
                type=endpoint,
                const="",
                metavar="ENDPOINT",
                help="also publish every message, on this endpoint (without ENDPOINT: that of the recorded config)",
            ),
        ),
    ),
    Command(
        "recover",
        "slipd.tools.recordings.recover:recover_command",
        "write what is intact of a damaged recording as a complete file",
        (
            argument("source", type=Path, metavar="RECORDING", help="recording, MCAP"),
            NEW_RECORDING,
            argument(
                "--without-secrets",
                action="store_true",
                help="remove passwords, tokens and keys from the config and all texts",
            ),
        ),
        "OUT has the index and the summary that other programs need, and states what is missing. Exit code 1: "
        "RECORDING is not of slipd, its start or all of it is damaged, or OUT cannot be written; then there is no OUT.",
    ),
    Command(
        "view",
        "slipd.tools.recordings.replay_commands:view_recording",
        "show a recording in a browser; prints the address of the page",
        (RECORDING, LISTEN),
    ),
    Command(
        "plot",
        "slipd.tools.plot.plot_command:plot_command",
        "draw a recording: levels, utilisation, forces, friction, health, pads",
        (
            RECORDING,
            argument("--beside", type=Path, metavar="RECORDING", help="draw this one beside the first"),
            argument(
                "--out",
                type=file_in(".html", "; a browser prints the page as a picture"),
                metavar="FILE",
                help="the page, .html (default: RECORDING.html in this folder)",
            ),
            argument(
                "--config",
                dest="config_file",
                type=Path,
                metavar="FILE",
                help="replay with this config instead of the recorded one",
            ),
            argument(
                "--from",
                dest="begin_s",
                type=time_s,
                default=0.0,
                metavar="S",
                help="draw from this time on (default 0)",
            ),
            argument(
                "--to",
                dest="end_s",
                type=positive,
                default=float("inf"),
                metavar="S",
                help="draw up to this time (default: the end)",
            ),
        ),
        "The page shows what the run itself reported; with --config the recording is replayed. Memory does not grow "
        "with the length of a recording. An existing file is replaced only if it is a plot. Exit code 1: a recording "
        "is damaged or cut off; it is drawn as far as it goes.",
    ),
    Command(
        "identify",
        "slipd.tools.recordings.identify_mass:identify_command",
        "find mass and centre of mass of a finger that was held still in several poses",
        (
            argument("path", type=Path, metavar="RECORDING", help="recording with gravity.set requests, MCAP"),
            argument("--finger", required=True, metavar="NAME", help="name of the finger in the config"),
            JSON,
        ),
    ),
    Command("import", "", "convert other data to a recording"),
    _import(
        "grips",
        "grips_import:import_trial",
        "import a gripper trial with two XELA pads",
        "folder with xela_sensor1.csv, xela_sensor2.csv and robot_state.csv",
        argument(
            "--tare-rows",
            type=int,
            metavar="N",
            help="take the zero of the pads from the first N rows, in which the fingers are open (default: the "
            "zero that the config states)",
        ),
        shipped="grips.toml",
    ),
    _import(
        "arq",
        "taxels_import:import_arq",
        "import an experiment of slip_detection_dataset_2021 (needs h5py)",
        "HDF5 file of an object",
        argument("experiment", metavar="EXPERIMENT", help="path in that file, such as GGCNN2/SpoolSolder/Pose1/Exp1"),
        shipped="trial_arq.toml",
    ),
    _import(
        "papillarray",
        "taxels_import:import_papillarray",
        "import a trial of Incipient-Slip-Detection-PapillArray",
        "CSV file",
        shipped="trial_papillarray.toml",
    ),
    _import(
        "pushes",
        "pushes_import:import_pushes",
        "import measured pushes of an object over a board",
        "ROS 1 bag of MLab_EXP (needs the extra bags), or its compact form, NPZ",
        argument(
            "--mass-kg",
            type=float,
            default=0.15,
            metavar="M",
            help="mass of the object, kg; if it is a guess, mu is relative to it (default: %(default)s)",
        ),
        argument(
            "--clear-s",
            type=float,
            nargs=2,
            default=(0.0, 0.4),
            metavar=("BEGIN", "END"),
            help="take the zero of the sensor from this time, s: the pusher touches nothing (default: 0 0.4)",
        ),
        shipped="pushes.toml",
    ),
    Command(
        "evaluate",
        "slipd.tools.evaluation.evaluate_command:evaluate_command",
        "compare what slipd reports on recordings with one config and another",
        (
            argument(
                "recordings",
                type=Path,
                nargs="+",
                metavar="RECORDING",
                help="recordings, MCAP; of a folder, all *.mcap in and below it",
            ),
            argument(
                "--config",
                type=Path,
                action="append",
                default=[],
                metavar="FILE",
                help="replay with this config too, beside the recorded one; may be given several times",
            ),
            one_of(
                argument(
                    "--out",
                    type=file_in(".parquet"),
                    metavar="FILE",
                    help="write a Parquet file with one row for each recording and config, and print only its totals",
                ),
                argument("--json", dest="as_json", action="store_true", help="print all figures as one JSON list"),
            ),
            argument(
                "--shard",
                type=shard,
                default=EVERY,
                metavar="I/N",
                help="replay only the I-th of N shares of the recordings: one for each machine of a cluster",
            ),
            argument(
                "--dask",
                metavar="ADDRESS",
                help="replay on the workers of this Dask scheduler, e.g. tcp://10.0.0.5:8786",
            ),
            argument(
                "--results",
                type=Path,
                metavar="FOLDER",
                help="keep all results in this folder, which several machines may share, instead of the newest in the "
                "cache",
            ),
        ),
        "The recorded motion stays as it was: a config changes what is reported on it, not what the robot would have "
        "done about that. The zero of the pads stays as recorded, too. Results are kept: what was replayed once with "
        "a config is not replayed again, and the same command continues after Ctrl-C. Exit code 1: a config gives "
        "other levels, or a recording is damaged or does not fit a config. docs/batches.md covers large batches.",
    ),
    Command(
        "export",
        "slipd.tools.export.export_command:export_command",
        "write recordings as files for other programs",
        (
            argument(
                "recordings",
                type=Path,
                nargs="+",
                metavar="RECORDING",
                help="recording, MCAP; for lerobot also several, or folders of them: each is an episode",
            ),
            argument("out", type=Path, metavar="OUT", help="new folder"),
            argument(
                "--to",
                choices=tuple(EXPORTS),
                required=True,
                metavar="|".join(EXPORTS),
                help="; ".join(f"{name}: {what}" for name, what in EXPORTS.items()),
            ),
            argument("--rate", dest="rate_hz", type=rate, metavar="HZ", help="with --to lerobot: frames per second"),
            argument(
                "--task", type=sentence, metavar="TEXT", help="with --to lerobot: what the robot does, in a sentence"
            ),
            argument("--overwrite", action="store_true", help="replace OUT if it is an earlier export"),
        ),
        "The recording is replayed, so the messages are those of this version of slipd. docs/viewers.md says which "
        "program opens what, docs/recordings.md what a data set for learning holds. Exit code 1: a recording is "
        "damaged, and the export ends there.",
    ),
)
