"""ROS 2 messages as others read them: the library `rosbags`, which shares no code with slipd."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from slipd_client.ros.conversion import TYPES
from slipd_client.ros.slipd_types import SLIPD_TYPES


def typestore() -> Typestore:
    """Return the types of ROS 2 Humble as rosbags ships them, that of control_msgs 6.8, and slipd_msgs by its files."""
    store = get_typestore(Stores.ROS2_HUMBLE)
    store.register(get_types_from_msg("float64 factor", "control_msgs/msg/SpeedScalingFactor"))
    for kind in SLIPD_TYPES.values():
        store.register(get_types_from_msg(kind.commented_text(), kind.full_name))
    return store


def built(store: Typestore, name: str, value: Mapping[str, Any]) -> Any:
    """Return a message of rosbags with these values; ``name`` is "package/Name"."""
    fields = {field.name: _value(store, field.type, field.length, value[field.name]) for field in TYPES[name].fields}
    return store.types[TYPES[name].full_name](**fields)


def _value(store: Typestore, kind: str, length: int | None, value: Any) -> Any:
    if kind in TYPES:
        return built(store, kind, value) if length is None else [built(store, kind, entry) for entry in value]
    if length is None or kind == "string":
        return value
    dtype = "uint8" if kind == "byte" else kind
    return np.frombuffer(value, dtype) if isinstance(value, bytes) else np.array(value, dtype=dtype)


def plain(message: Any, name: str) -> dict[str, Any]:
    """Return a message that another library decoded as numbers, strings, lists and maps."""
    return {field.name: _plain(getattr(message, field.name), field.type) for field in TYPES[name].fields}


def _plain(value: Any, kind: str) -> Any:
    if kind in TYPES:
        return [plain(entry, kind) for entry in value] if isinstance(value, list | tuple) else plain(value, kind)
    if isinstance(value, bytes) or (isinstance(value, np.ndarray) and value.dtype == np.uint8):
        return bytes(value)
    return value.tolist() if isinstance(value, np.ndarray) else list(value) if isinstance(value, tuple) else value
