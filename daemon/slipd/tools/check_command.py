"""The command ``slipd check``: the streams of a config, what looks wrong in it, and what the reflex can do."""

from __future__ import annotations

from pathlib import Path
from typing import cast

from slipd import config
from slipd.config import Config, Gripper
from slipd.gripper.reflex import PERIOD_NS
from slipd.types.device_text import printable


def check_command(file: Path) -> None:
    """Check a config, and print what it is.

    Raises:
        ConfigError: It cannot be read or has faults.
    """
    rig = config.load(file)
    for name, stream in rig.streams().items():
        print(f"{name}: {stream.device} on {stream.port}, {stream.rate_hz:g} Hz")
    for hint in config.hints(rig, str(file)):
        print(printable(hint))
    if rig.reflex.enabled:
        print(_reflex_text(rig))
    print(f"{file}: valid, config_id {rig.config_id}")


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
