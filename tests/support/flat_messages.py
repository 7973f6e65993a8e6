"""Messages as the columns of a table."""

from __future__ import annotations

from typing import Any

ENDS = {2: "xy", 3: "xyz"}


def flat(value: Any, name: str = "", *, spread: bool = True) -> dict[str, Any]:
    """Return the columns that a value of the wire has, by name; ``spread``: each load of a pad has one."""
    if isinstance(value, dict) and not name.endswith(("taxel_faults", "notices")):
        prefix = f"{name}." if name else ""
        return {
            key: each
            for part, inner in value.items()
            for key, each in flat(inner, prefix + part, spread=spread).items()
        }
    vector = isinstance(value, list) and name.endswith(("_n", "_m", "_nm")) and name != "corners_m"
    if vector and len(value) in ENDS:
        return {f"{name}.{end}": each for end, each in zip(ENDS[len(value)], value, strict=True)}
    if name == "loads_n" and value is not None and spread:
        return {f"{name}.{index}": each for index, each in enumerate(value)}
    return {name: value}
