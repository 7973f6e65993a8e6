"""Hours of a robot's work on a slow rig in simulated time: does the daemon grow, lose messages, or stop working?

    make soak    (runs this after the other parts; writes docs/simulated_hours.md)
    PYTHONPATH=tests/support:tests/lab python -m shifts [--hours H] [--trace-hours H] [--most-minutes M] [--seed S]
        [--quick] [--report FILE]

The daemon is the real one with its sockets, recordings and incidents; only its clock and its links are simulated. The
devices are the emulators of ``slipd emulate``; their lines fail, one seeded fault after another. A second, shorter run
traces every allocation. The report is printed, and ``--report`` also writes it as Markdown.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
from pathlib import Path

from bench.child import BenchError
from bench.commit import measured_on
from shifts.shift_report import grown, overdrawn, recorded, traced, worked
from shifts.shift_watch import watch


def main(argv: list[str] | None = None) -> int:
    """Run and print; return 1 where something grew (not with ``--quick``), was lost, or did not hold."""
    parser = argparse.ArgumentParser(prog="python -m shifts", description="Hours of work in simulated time.")
    parser.add_argument("--hours", type=float, default=10.0, help="simulated hours (default 10)")
    parser.add_argument(
        "--trace-hours", type=float, default=0.15, help="simulated hours with traced memory (default 0.15; 0: none)"
    )
    parser.add_argument(
        "--most-minutes", type=float, default=120.0, metavar="M", help="end the hours after so long (default 120)"
    )
    parser.add_argument("--seed", type=int, default=1, help="seed of noise, jobs and faults (default 1)")
    parser.add_argument("--quick", action="store_true", help="two minutes of simulated time, to check the program")
    parser.add_argument("--report", type=Path, metavar="FILE", help="also write the report as Markdown")
    options = parser.parse_args(argv)
    hours, trace_hours = (2 / 60, 1 / 60) if options.quick else (options.hours, options.trace_hours)
    header = measured_on()
    print(f"slipd simulated hours: {header}", flush=True)
    pages = [f"# Hours of work in simulated time\n\n{header}. Made by `make soak`; `tests/lab/shifts` is the program."]
    try:
        with tempfile.TemporaryDirectory(prefix="slipd-shifts-") as name:
            folder = Path(name)
            os.environ["SLIPD_RUNTIME_DIR"] = str(folder / "run")
            found = watch(folder, options.seed, hours, 60.0 * options.most_minutes)
            tables = [grown(found), worked(found), recorded(found)]
            if trace_hours:
                tables.append(traced(watch(folder, options.seed + 1, trace_hours, 600.0, trace=True)))
    except BenchError as error:
        print(f"shifts: {error}", file=sys.stderr)
        return 1
    for table in tables:
        print(table.text(), flush=True)
        pages.append(table.markdown())
    if options.report:
        options.report.write_text("\n".join(pages) + "\n", encoding="utf-8")
    grew = not options.quick and overdrawn(tables[0])
    return 0 if found.sound and not grew else 1


if __name__ == "__main__":
    sys.exit(main())
