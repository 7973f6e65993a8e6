"""The command ``slipd check``: the streams of a config, what looks wrong in it, and what the reflex can do."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any, cast

from slipd.config import Config, Gripper, hints, load
from slipd.errors import ConfigError, printable
from slipd.gripper.reflex import PERIOD_NS


def check_command(config: Path, *, as_json: bool) -> bool:
    """Check a config, and print what it is; as JSON one document.

    Returns:
        Whether it has no fault.

    Raises:
        ConfigError: There is no such file.
    """
    try:
        rig = load(config)
    except ConfigError as error:
        if not config.is_file():
            raise
        if as_json:
            faults = [{"key": fault.path, "line": fault.line, "message": fault.message} for fault in error.faults]
            print(json.dumps({"file": str(config), "valid": False, "faults": faults}, ensure_ascii=False))
        else:
            print(error, file=sys.stderr)
        return False
    streams = {
        name: {"device": stream.device, "port": stream.port, "rate_hz": stream.rate_hz}
        for name, stream in rig.streams().items()
    }
    remarks = [printable(hint) for hint in hints(rig, str(config))]
    remarks += [_reflex_text(rig)] if rig.reflex.enabled else []
    if as_json:
        found: dict[str, Any] = {"file": str(config), "valid": True, "faults": [], "config_id": rig.config_id}
        print(json.dumps(found | {"streams": streams, "hints": remarks}, ensure_ascii=False))
        return True
    for name, each in streams.items():
        print(f"{name}: {each['device']} on {each['port']}, {each['rate_hz']:g} Hz")
    for line in [*remarks, f"{config}: valid, config_id {rig.config_id}"]:
        print(line)
    return True


def _reflex_text(rig: Config) -> str:
    """Return how much force the reflex can add within the configured lead time."""
    reflex, gripper = rig.reflex, cast("Gripper", rig.gripper)  # the checks want one
    ceiling_n = reflex.ceiling_n or gripper.max_force_n or 0.0
    gain_n = min(
        reflex.raise_n_per_s * (reflex.lead_time_s + PERIOD_NS * 1e-9),
        gripper.step_n + gripper.raise_n_per_s * reflex.lead_time_s,
        gripper.budget_n or ceiling_n,
        ceiling_n,
    )
    return (
        f"reflex: adds up to {gain_n:.1f} N within the lead time of {reflex.lead_time_s:g} s,"
        f" up to {ceiling_n:g} N on one pad; the response time of the gripper is not included"
    )
