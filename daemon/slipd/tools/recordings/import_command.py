"""``slipd import``: make a recording of measurements from elsewhere."""

from __future__ import annotations

import argparse

from slipd import config
from slipd.tools.cli_arguments import IMPORTED
from slipd.tools.recordings.grips_import import import_trial
from slipd.tools.recordings.pushes_import import import_pushes
from slipd.tools.recordings.taxels_import import import_taxels, read_arq, read_papillarray


def import_command(arguments: argparse.Namespace) -> None:
    """Import what the arguments name, and print what follows.

    Raises:
        SlipdError: The source or the config has faults, or the recording cannot be written.
    """
    rig = config.load(arguments.config or config.shipped(IMPORTED[arguments.command.removeprefix("import ")]))
    if arguments.command == "import grips":
        for finding in import_trial(arguments.source, arguments.out, rig.text, arguments.tare_rows):
            print(finding)
    elif arguments.command == "import arq":
        import_taxels(read_arq(arguments.source, arguments.experiment), arguments.out, rig.text)
    elif arguments.command == "import papillarray":
        import_taxels(read_papillarray(arguments.source), arguments.out, rig.text)
    else:
        begin_s, end_s = arguments.clear_s
        import_pushes(arguments.source, arguments.out, rig.text, arguments.mass_kg, (begin_s, end_s))
    print(f"{arguments.out}: written; replay it with: slipd replay {arguments.out} --speed max")
