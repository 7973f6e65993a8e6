"""The command ``slipd`` and what carries out each of its subcommands.

Each command imports what it needs.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import sys
from typing import NoReturn

from slipd.errors import ConfigError, SlipdError
from slipd.io.log_lines import log_uncaught, open_log
from slipd.tools.cli_parser import parser
from slipd.types.device_text import printable_lines

DONE, FAULT, WRONG, INTERRUPTED = 0, 1, 2, 130

ENDED_BY_HAND = ("run", "demo", "replay", "view", "emulate")
"""Commands that Ctrl-C ends normally."""


def main(argv: list[str] | None = None) -> int:
    """Run one command; return its exit code: 0 done, 1 fault at run time, 2 wrong call or config, 130 interrupted."""
    arguments = parser().parse_args(argv)
    open_log()
    if argv is None:
        for stream in (sys.stdout, sys.stderr):
            stream.reconfigure(errors="replace")  # type: ignore[union-attr] # what it cannot show is a "?"
        log_uncaught()
    code = _exit_code(arguments)
    if argv is None and arguments.command == "run":
        _end_process(code)
    return code


def _exit_code(arguments: argparse.Namespace) -> int:
    try:
        return COMMANDS[arguments.command](arguments)
    except ConfigError as error:
        print(error, file=sys.stderr)
        return WRONG
    except SlipdError as error:
        print(f"slipd: {printable_lines(str(error))}", file=sys.stderr)
        return FAULT
    except KeyboardInterrupt:
        if arguments.command in ENDED_BY_HAND:
            return DONE
        print("slipd: interrupted", file=sys.stderr)
        return INTERRUPTED
    except BrokenPipeError:
        sys.stderr.close()  # the reader of the output is gone, and with it the reader of an error
        return DONE


def _first_steps(_: argparse.Namespace) -> int:
    from slipd.tools.shipped_command import FIRST_STEPS

    print(FIRST_STEPS)
    return WRONG


def _end_process(code: int) -> NoReturn:
    """End without taking down the interpreter: all is closed, and that alone takes longer than a stop may."""
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(OSError, ValueError):
            stream.flush()
    os._exit(code)


def _run(arguments: argparse.Namespace) -> int:
    from slipd.run_command import run_command

    run_command(arguments.config, arguments.record)
    return DONE


def _demo(arguments: argparse.Namespace) -> int:
    from slipd.tools.demo import run_demo

    return run_demo(arguments.seconds, headless=arguments.headless, seed=arguments.seed, record=arguments.record)


def _identify(arguments: argparse.Namespace) -> int:
    from slipd.recording.identify_mass import identification_text, identify_recording

    print(identification_text(identify_recording(arguments.file, arguments.finger), arguments.finger))
    return DONE


def _check(arguments: argparse.Namespace) -> int:
    from slipd.tools.check_command import check_command

    check_command(arguments.config)
    return DONE


def _config_list(_: argparse.Namespace) -> int:
    from slipd.tools.shipped_command import print_configs

    print_configs()
    return DONE


def _config_show(arguments: argparse.Namespace) -> int:
    from slipd.tools.shipped_command import print_config

    print_config(arguments.name)
    return DONE


def _docs(arguments: argparse.Namespace) -> int:
    from slipd.tools.shipped_command import print_page, print_pages

    if arguments.name is None:
        print_pages()
    else:
        print_page(arguments.name)
    return DONE


def _slipctl(arguments: argparse.Namespace) -> int:
    call = " ".join(["slipctl", arguments.name, *arguments.rest])
    print(f"slipd: {arguments.name} is a command of slipctl, which asks a running daemon: {call}", file=sys.stderr)
    return WRONG


def _service(arguments: argparse.Namespace) -> int:
    from slipd.tools.service_command import ServiceFiles, own_program

    files = ServiceFiles(arguments.system, arguments.root, arguments.program or own_program())
    (files.install if arguments.command == "service install" else files.uninstall)()
    return DONE


def _replay(arguments: argparse.Namespace) -> int:
    from slipd.tools.replay_command import replay_command

    whole = replay_command(arguments.file, arguments.speed, as_json=arguments.json, publish=arguments.publish)
    return DONE if whole else FAULT


def _recover(arguments: argparse.Namespace) -> int:
    from slipd.io.progress import Progress
    from slipd.recording.recover import recover
    from slipd_client.health.bundle import without_secrets

    clean = without_secrets if arguments.without_secrets else str
    with Progress(lambda done, of: f"{100 * done // max(of, 1)} % of the recording").shown() as show:
        found = recover(arguments.file, arguments.out, clean, show)
    for fault in found.faults:
        print(f"{arguments.file}: {fault}")
    lost = f"{found.lost} known to be missing" if found.lost or found.faults else "nothing was missing"
    print(f"{arguments.out}: {found.entries} entries, {lost}")
    return DONE


def _view(arguments: argparse.Namespace) -> int:
    from slipd.recording.view_recording import view_recording

    view_recording(arguments.file, arguments.listen)
    return DONE


def _evaluate(arguments: argparse.Namespace) -> int:
    from slipd.tools.evaluation.evaluate_command import EvaluateCommand
    from slipd.tools.evaluation.executors import on_dask
    from slipd.tools.evaluation.recording_choice import chosen
    from slipd.tools.evaluation.result_cache import ResultCache, cache_folder

    if arguments.table is not None and arguments.json:
        raise SlipdError("--table writes a file and --json prints: give one of them")
    results = arguments.results
    cache = ResultCache(cache_folder()) if results is None else ResultCache(results, pruned=False)
    executor = None if arguments.dask is None else on_dask(arguments.dask)
    command = EvaluateCommand(chosen(arguments.recordings, arguments.shard), arguments.config, cache, executor)
    try:
        if arguments.table is not None:
            return DONE if command.write(arguments.table) else FAULT
        return DONE if command.show(arguments.out, as_json=arguments.json) else FAULT
    except KeyboardInterrupt:
        print("slipd: interrupted; the same command goes on from here", file=sys.stderr)
        return INTERRUPTED


def _plot(arguments: argparse.Namespace) -> int:
    from slipd.tools.plot.binned_track import Window
    from slipd.tools.plot.plot_command import plot_command

    window = Window(arguments.begin_s, arguments.end_s)
    whole = plot_command(arguments.file, arguments.out, arguments.config, window)
    return DONE if whole else FAULT


def _export(arguments: argparse.Namespace) -> int:
    from slipd.tools.export.export_command import ExportOptions, export_command

    options = ExportOptions(arguments.to, arguments.rate, arguments.task, arguments.overwrite)
    try:
        whole = export_command(arguments.recordings, arguments.out, options)
    except KeyboardInterrupt:
        print("slipd: interrupted; nothing was written", file=sys.stderr)
        return INTERRUPTED
    return DONE if whole else FAULT


def _devices(arguments: argparse.Namespace) -> int:
    from slipd.tools.devices_command import print_devices

    print_devices(arguments.name)
    return DONE


def _doctor(arguments: argparse.Namespace) -> int:
    from slipd.tools.discovery.doctor_command import doctor

    return DONE if doctor(arguments) else FAULT


def _init(arguments: argparse.Namespace) -> int:
    from slipd.tools.discovery.init_command import init_command

    init_command(arguments.file, arguments.ports, only_list=arguments.list)
    return DONE


def _commission(arguments: argparse.Namespace) -> int:
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
    try:
        return DONE if commission_command(arguments.file, options) else FAULT
    except KeyboardInterrupt:
        print("\nslipd: interrupted; the present step changed nothing, the gripper keeps its force", file=sys.stderr)
        return INTERRUPTED


def _emulate(arguments: argparse.Namespace) -> int:
    from slipd.tools.sim.emulate_command import emulate_command

    emulate_command(arguments.file, arguments.dir, arguments.script, arguments.seed)
    return DONE


def _touch(arguments: argparse.Namespace) -> int:
    from slipd.tools.sim.emulate_command import touch_command

    return touch_command(arguments.dir, arguments.words)


def _import_grips(arguments: argparse.Namespace) -> int:
    from slipd import config
    from slipd.recording.grips_import import import_trial

    rig = config.load(arguments.config or config.shipped("grips.toml"))
    import_trial(arguments.source, arguments.out, rig.text, arguments.tare_rows)
    print(f"{arguments.out}: written; replay it with: slipd replay {arguments.out} --speed max")
    return DONE


COMMANDS = {
    "": _first_steps,
    "run": _run,
    "demo": _demo,
    "check": _check,
    "config list": _config_list,
    "config show": _config_show,
    "docs": _docs,
    "slipctl": _slipctl,
    "service install": _service,
    "service uninstall": _service,
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
    "import grips": _import_grips,
}
"""What carries out each command of the parser."""
