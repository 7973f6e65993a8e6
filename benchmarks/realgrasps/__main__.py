"""Measure slipd on real grasps that lie in a folder of your own.

    PYTHONPATH=tests/support:benchmarks python -m realgrasps FOLDER [--config FILE] [--tare-rows N] [--json]

Every trial is imported with ``slipd import grips --tare-rows N`` into a temporary folder, replayed through the engine,
and compared with its label. Printed are, by trial and in total: slips reported by the time that the object has moved by
5 mm or 5° and by 10 mm or 10°, drops warned of at least 0.3 s before, holds with an alarm, alarms before the slip
began, and the evidence and reasons that the alarms name; for the levels ``warning`` and ``slipping`` together, and for
``slipping`` alone.

A slip counts as reported by an alarm of any finger, or of the grasp, that is on at some time from the begin of the
motion to the limit, or was raised within 0.5 s before the begin. Alarms before that are counted as early. An alarm
that is always on reports every slip, so read the counts beside the early alarms. The laxer counts accept any alarm
since the grasp.

No such data are in this repository. Trials that fit are, for example, those of github.com/imanlab/tactile_prediction_
flat_dataset; they have no licence, so they may be measured but not passed on. To lay data out, make a folder of

    FOLDER/labels.csv
    FOLDER/NAME/xela_sensor1.csv    one row per reading: columns txl1_x, txl1_y, txl1_z … txl16_z, raw counts
    FOLDER/NAME/xela_sensor2.csv    the other pad, as many rows
    FOLDER/NAME/robot_state.csv     as many rows: column time, s; other columns are ignored

Every trial begins with open fingers, at least N rows long. If the source has no time for each row, write row number
divided by the rate. ``labels.csv`` has one row per trial, and the columns

    name        folder of the trial
    object      what was grasped
    rate_hz     rows per second; for people
    dropped     1 where the object fell out of the hand, else 0
    grasp_row   first row in which the grip is closed and its force has settled; rows count from 0
    end_row     last row that counts: the object falls, or just before the hand opens
    kind        slip, hold (the object did not move), or unclear (counted nowhere)
    begin_row   first row of the motion over the pads; empty without a slip
    onset_row   first row in which the object has moved by 5 mm or turned by 5° against the pads; empty without a slip
    far_row     first row with 10 mm or 10°; empty where it never moved so far

The rows come from a measurement that does not depend on the pads, such as markers on the object and on the gripper:
take the pose of the object relative to the gripper, smooth it over a few rows, and compare it with that at
``grasp_row``. The begin is the last row before the onset in which the pose still was within the noise of the markers.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

from realgrasps.labels import LabelError
from realgrasps.report import lines, totals
from realgrasps.trials import measure

from slipd import config
from slipd.errors import SlipdError
from slipd.tools.shipped_files import shipped_config

TARE_ROWS = 30
"""Rows with open fingers at the begin of every trial."""


def main(argv: list[str] | None = None) -> int:
    """Measure every trial and print the figures; return 1 if a trial cannot be measured, else 0."""
    parser = argparse.ArgumentParser(prog="python -m realgrasps", description="Measure slipd on real grasps.")
    parser.add_argument("folder", type=Path, metavar="FOLDER", help="folder with labels.csv and one folder per trial")
    parser.add_argument(
        "--config", type=Path, metavar="FILE", help="config of the rig (default: the shipped grips.toml)"
    )
    parser.add_argument(
        "--tare-rows",
        type=int,
        default=TARE_ROWS,
        metavar="N",
        help=f"first rows with open fingers (default {TARE_ROWS})",
    )
    parser.add_argument("--json", action="store_true", help="print all of it as one JSON object")
    options = parser.parse_args(argv)
    try:
        rig = config.load(options.config or shipped_config("grips.toml"))
        trials = measure(options.folder, rig.text, options.tare_rows)
    except (LabelError, SlipdError) as error:
        print(f"realgrasps: {error}", file=sys.stderr)
        return 1
    if options.json:
        print(json.dumps({"trials": [trial.as_map() for trial in trials], "totals": totals(trials)}, indent=1))
    else:
        print("\n".join(lines(trials)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
