"""``slipd import``: make a recording of measurements from elsewhere."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from slipd import config
from slipd.tools.cli_arguments import IMPORTED
from slipd.tools.recordings.grips_import import import_trial
from slipd.tools.recordings.pushes_import import import_pushes
from slipd.tools.recordings.taxels_import import import_taxels, read_arq, read_papillarray


def import_command(form: str, source: Path, out: Path, config_file: Path | None, **more: Any) -> None:
    """Import data, and print what follows.

    Args:
        form: Their format, one of `IMPORTED`.
        source: The data.
        out: New recording.
        config_file: Config; None: the shipped one of the format.
        more: What this format alone needs.

    Raises:
        SlipdError: The source or the config has faults, or the recording cannot be written.
    """
    rig = config.load(config_file or config.shipped(IMPORTED[form]))
    if form == "grips":
        for finding in import_trial(source, out, rig.text, more["tare_rows"]):
            print(finding)
    elif form == "arq":
        import_taxels(read_arq(source, more["experiment"]), out, rig.text)
    elif form == "papillarray":
        import_taxels(read_papillarray(source), out, rig.text)
    else:
        begin_s, end_s = more["clear_s"]
        import_pushes(source, out, rig.text, more["mass_kg"], (begin_s, end_s))
    print(f"{out}: written; replay it with: slipd replay {out} --speed max")
