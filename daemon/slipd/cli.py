"""The command ``slipd`` and what carries out each of its subcommands.

Each command imports what it needs. It returns False where the answer is no, for example where a recording is damaged.
"""

from __future__ import annotations

import argparse
import contextlib
import difflib
import os
import sys
from typing import NoReturn

from slipd.errors import ConfigError, SlipdError, UsageError
from slipd.io.log_lines import log_uncaught, open_log
from slipd.tools.cli_parser import parser
from slipd.types.device_text import printable_lines

DONE, NO, WRONG, INTERRUPTED = 0, 1, 2, 130
"""Exit codes, those of ``slipctl`` too; docs/commands.md explains them."""

ENDED_IN_ORDER = ("run", "demo")
"""Commands that Ctrl-C ends in good order: recordings are closed, and the demo prints its summary."""

SERVING = ("view", "emulate")
"""Commands that run until Ctrl-C, which ends them without a message."""

SLIPCTL = {
    **{name: name for name in ("watch", "status", "diagnose", "grip", "tare", "friction", "gravity", "object")},
    **{name: name for name in ("record", "keys", "fleet", "serve")},
    "viewers": "serve foxglove",
    "relay": "serve foxglove",
    "ros2": "serve ros2",
    "bridge": "serve fleet",
}
"""Commands of ``slipctl`` alone, to which ``slipd`` points those who mistake one for the other."""

RENAMED = {("evaluate", "--table"): "slipd evaluate --table FILE is now: slipd evaluate --out FILE.parquet"}
"""Options of earlier versions, and what to type instead."""

_INTERRUPTED = {
    "evaluate": "; the same command goes on from here",
    "export": "; nothing was written",
    "commission": "; the present step changed nothing, the gripper keeps its force",
}


def main(argv: list[str] | None = None) -> int:
    """Run one command; return its exit code: 0 done, 1 the answer is no, 2 wrong use, 130 interrupted."""
    words = sys.argv[1:] if argv is None else argv
    if hint := _hint(words):
        print(f"slipd: {hint}", file=sys.stderr)
        return WRONG
    arguments = parser().parse_args(words)
    open_log()
    if argv is None:
        for stream in (sys.stdout, sys.stderr):
            stream.reconfigure(errors="replace")  # type: ignore[union-attr] # what it cannot show is a "?"
        log_uncaught()
    code = _exit_code(arguments)
    if argv is None and arguments.command == "run":
        _end_process(code)
    return code


def _hint(words: list[str]) -> str:
    """Return what to type instead of a command of ``slipctl``, a misspelt one or an earlier name; "" for nothing."""
    command, *rest = words or [""]
    if command in SLIPCTL:
        call = " ".join(["slipctl", SLIPCTL[command], *rest])
        return f"{command} is a command of slipctl, which asks a running daemon: {call}"
    names = {name.partition(" ")[0] for name in COMMANDS} | set(SLIPCTL)
    near = [] if command in names or command.startswith("-") else difflib.get_close_matches(command, names, n=1)
    if near:
        return f"there is no command {command!r}; did you mean {near[0]!r}?"
    return next((RENAMED[command, word] for word in rest if (command, word) in RENAMED), "")


def _exit_code(arguments: argparse.Namespace) -> int:
    try:
        return NO if COMMANDS[arguments.command](arguments) is False else DONE
    except ConfigError as error:
        print(error, file=sys.stderr)
        return WRONG
    except SlipdError as error:
        print(f"slipd: {printable_lines(str(error))}", file=sys.stderr)
        is_wrong_use = isinstance(error, UsageError) or isinstance(error.__cause__, FileNotFoundError)
        return WRONG if is_wrong_use else NO
    except KeyboardInterrupt:
        if arguments.command in ENDED_IN_ORDER:
            return DONE
        if arguments.command not in SERVING:
            print(f"slipd: interrupted{_INTERRUPTED.get(arguments.command, '')}", file=sys.stderr)
        return INTERRUPTED
    except BrokenPipeError:
        sys.stderr.close()  # the reader of the output is gone, and with it the reader of an error
        return DONE


def _end_process(code: int) -> NoReturn:
    """End without taking down the interpreter: all is closed, and that alone takes longer than a stop may."""
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(OSError, ValueError):
            stream.flush()
    os._exit(code)


def _first_steps(_: argparse.Namespace) -> None:
    from slipd.tools.shipped_command import FIRST_STEPS

    print(FIRST_STEPS)
    raise UsageError("a command is missing; slipd --help lists all")


def _run(arguments: argparse.Namespace) -> None:
    from slipd.service import run_command

    run_command(arguments.config, arguments.record)


def _demo(arguments: argparse.Namespace) -> bool:
    from slipd.tools.demo import Scene, run_demo

    scene = Scene(arguments.scene == "carry", not arguments.without_advice)
    return run_demo(
        arguments.seconds, headless=arguments.headless, seed=arguments.seed, record=arguments.record, scene=scene
    )


def _identify(arguments: argparse.Namespace) -> None:
    from slipd.tools.recordings.identify_mass import identify_command

    identify_command(arguments.file, arguments.finger, as_json=arguments.json)


def _check(arguments: argparse.Namespace) -> bool:
    from slipd.tools.check_command import check_command

    return check_command(arguments.config, as_json=arguments.json)


def _shipped(arguments: argparse.Namespace) -> None:
    from slipd.tools import shipped_command

    name = getattr(arguments, "name", None)
    if name is None:
        shipped_command.list_files(arguments.command, as_json=arguments.json)
    else:
        shipped_command.print_file(arguments.command, name)


def _service(arguments: argparse.Namespace) -> None:
    from slipd.tools.service_command import ServiceFiles, own_program

    files = ServiceFiles(arguments.system, arguments.root, arguments.program or own_program())
    (files.install if arguments.command == "service install" else files.uninstall)()


def _info(arguments: argparse.Namespace) -> bool:
    from slipd.tools.recordings.info import info_command

    return info_command(arguments.file, as_json=arguments.json)


def _replay(arguments: argparse.Namespace) -> bool:
    from slipd.tools.replay_command import replay_command

    return replay_command(arguments.file, arguments.speed, as_json=arguments.json, publish=arguments.publish)


def _recover(arguments: argparse.Namespace) -> None:
    from slipd.tools.recordings.recover import recover_command

    recover_command(arguments.file, arguments.out, without_secrets=arguments.without_secrets)


def _view(arguments: argparse.Namespace) -> None:
    from slipd.tools.recordings.view_recording import view_recording

    view_recording(arguments.file, arguments.listen)


def _evaluate(arguments: argparse.Namespace) -> bool:
    from slipd.tools.cli_arguments import chosen
    from slipd.tools.evaluation.evaluate_command import evaluate_command
    from slipd.tools.evaluation.executors import on_dask
    from slipd.tools.evaluation.result_cache import ResultCache, cache_folder

    results = arguments.results
    return evaluate_command(
        chosen(arguments.recordings, arguments.shard),
        arguments.config,
        ResultCache(cache_folder()) if results is None else ResultCache(results, pruned=False),
        None if arguments.dask is None else on_dask(arguments.dask),
        out=arguments.out,
        as_json=arguments.json,
    )


def _plot(arguments: argparse.Namespace) -> bool:
    from slipd.tools.plot.binned_track import Window
    from slipd.tools.plot.plot_command import plot_command

    return plot_command(arguments.file, arguments.out, arguments.config, Window(arguments.begin_s, arguments.end_s))


def _export(arguments: argparse.Namespace) -> bool:
    from slipd.tools.export.export_command import ExportOptions, export_command

    options = ExportOptions(arguments.to, arguments.rate, arguments.task, arguments.overwrite)
    return export_command(arguments.recordings, arguments.out, options)


def _devices(arguments: argparse.Namespace) -> None:
    from slipd.tools.devices_command import print_devices

    print_devices(arguments.name, as_json=arguments.json)


def _doctor(arguments: argparse.Namespace) -> bool:
    from slipd.tools.discovery.doctor_command import doctor

    return doctor(arguments)


def _init(arguments: argparse.Namespace) -> None:
    from slipd.tools.discovery.config_draft import init_command

    init_command(arguments.file, arguments.ports, only_list=arguments.list)


def _commission(arguments: argparse.Namespace) -> bool:
    from slipd.tools.commission.commission_command import CommissionOptions, commission_command

    options = CommissionOptions(
        arguments.finger,
        arguments.first,
        arguments.patience,
        not arguments.dry_run,
        arguments.publish,
        arguments.requests,
        arguments.key,
        arguments.server_key,
        arguments.page,
    )
    return commission_command(arguments.file, options)


def _emulate(arguments: argparse.Namespace) -> None:
    from slipd.tools.sim.emulate_command import emulate_command

    emulate_command(arguments.file, arguments.dir, arguments.script, arguments.seed, unkind=arguments.unkind)


def _touch(arguments: argparse.Namespace) -> bool:
    from slipd.tools.sim.emulate_command import touch_command

    return touch_command(arguments.dir, arguments.words) == DONE


def _import(arguments: argparse.Namespace) -> None:
    from slipd.tools.recordings.import_command import import_command

    import_command(arguments)


COMMANDS = {
    "": _first_steps,
    "run": _run,
    "demo": _demo,
    "check": _check,
    "config list": _shipped,
    "config show": _shipped,
    "docs": _shipped,
    "service show": _shipped,
    "service install": _service,
    "service uninstall": _service,
    "info": _info,
    "replay": _replay,
    "recover": _recover,
    "view": _view,
    "evaluate": _evaluate,
    "export": _export,
    "plot": _plot,
    "identify": _identify,
    "devices": _devices,
    "doctor": _doctor,
    "init": _init,
    "commission": _commission,
    "emulate": _emulate,
    "touch": _touch,
    "import grips": _import,
    "import pushes": _import,
    "import arq": _import,
    "import papillarray": _import,
}
"""What carries out each command of the parser."""
