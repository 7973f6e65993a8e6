"""Values of ROS messages as maps, and as objects with attributes, which is how readers have them."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any


def time(t_ns: int) -> dict[str, int]:
    return dict(zip(("sec", "nanosec"), divmod(t_ns, 10**9), strict=True))


def header(stamp_ns: int, frame: str) -> dict[str, Any]:
    return {"stamp": time(stamp_ns), "frame_id": frame}


def numbers(value: Any, axes: str = "xyz") -> dict[str, float]:
    """Return a vector, or with axes "xyzw" a quaternion."""
    return dict(zip(axes, map(float, value), strict=True))


def transform(stamp_ns: int, parent: str, child: str, quaternion: Any, at_m: Any = (0.0, 0.0, 0.0)) -> dict[str, Any]:
    place = {"translation": numbers(at_m), "rotation": numbers(quaternion, "xyzw")}
    return {"header": header(stamp_ns, parent), "child_frame_id": child, "transform": place}


def imu(
    stamp_ns: int,
    force: Any = (0.0, 0.0, 9.80665),
    turn: Any = (0.0, 0.0, 0.0),
    orientation: Any = (0.0, 0.0, 0.0, 1.0),
    unknown: str = "",
) -> dict[str, Any]:
    """Return the message of an IMU, which may lack one quantity: ``unknown`` names it."""
    vectors = {"linear_acceleration": numbers(force), "angular_velocity": numbers(turn)}
    values = vectors | {"orientation": numbers(orientation, "xyzw")}
    covariances = {f"{name}_covariance": [-1.0 if name == unknown else 0.0, *[0.0] * 8] for name in values}
    return {"header": header(stamp_ns, "imu"), **values, **covariances}


def attributes(value: Any) -> Any:
    """Return a message as readers have it."""
    if isinstance(value, dict):
        return SimpleNamespace(**{name: attributes(each) for name, each in value.items()})
    return [attributes(each) for each in value] if isinstance(value, list) else value
