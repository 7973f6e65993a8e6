"""A fleet on loopback: what the bridge adds, whether warnings are lost, and how soon a robot that vanishes is shown.

    make fleet    (about three minutes; writes docs/fleet_measured.md)
    PYTHONPATH=tests/support:tests/lab python -m fleet [--robots N] [--crowd N] [--seconds S] [--report FILE]

Each robot is a publishing daemon (`fleet.robot`) with a `slipctl bridge`, each in a process of its own. One process
hears all daemons directly, another all of them through a router.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from importlib.metadata import version
from pathlib import Path

from bench.child import BenchError
from bench.commit import measured_on
from fleet import outage, scale, steady, vanishing, wire
from fleet.network import Network
from replays import messages

ROBOTS, SECONDS = 20, 30.0
RECORDING = "demo"


def main() -> int:
    """Measure and print; returns the exit code."""
    parser = argparse.ArgumentParser(prog="python -m fleet", description="Measure a fleet on this machine.")
    parser.add_argument(
        "--robots", type=int, default=ROBOTS, metavar="N", help="number of robots (default: %(default)s)"
    )
    parser.add_argument(
        "--crowd", type=int, default=scale.ROBOTS, metavar="N", help="robots of one process (default: %(default)s)"
    )
    parser.add_argument("--seconds", type=float, default=SECONDS, metavar="S", help="of the steady part (default: 30)")
    parser.add_argument("--report", type=Path, metavar="FILE", help="also write the report as Markdown")
    options = parser.parse_args()
    pages = ["# Fleet, measured"]
    try:
        with tempfile.TemporaryDirectory(prefix="slipd-fleet-") as name:
            folder = Path(name)
            with Network(folder, write_course(folder / "course.json"), options.robots) as network:
                tables = [steady.run(network, folder, options.seconds)]
                tables.append(wire.run(network))
                tables.append(scale.run(network, options.crowd))
                tables.append(outage.run(network, folder))
                tables.append(vanishing.run(network))
    except BenchError as error:
        print(f"fleet: {error}", file=sys.stderr)
        return 1
    header = measured_on(f"eclipse-zenoh {version('eclipse-zenoh')}")
    pages += [f"\n{header}.", *(table.markdown() for table in tables)]
    print(f"slipd fleet: {header}", *(table.text() for table in tables), sep="\n", flush=True)
    if options.report:
        options.report.write_text("\n".join(pages) + "\n", encoding="utf-8")
    return 0


def write_course(file: Path) -> Path:
    """Write the messages of a recorded run, with their times from its begin, s; return the file."""
    found = messages(RECORDING)
    first_ns = min(body["t_ns"] for _, body in found)
    course = sorted(((body["t_ns"] - first_ns) * 1e-9, n, topic) for n, (topic, body) in enumerate(found))
    file.write_text(json.dumps([(at_s, topic, found[n][1]) for at_s, n, topic in course]), encoding="utf-8")
    return file


if __name__ == "__main__":
    sys.exit(main())
