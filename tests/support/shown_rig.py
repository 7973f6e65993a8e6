"""Messages of a small rig, and how the live view draws them."""

from __future__ import annotations

from typing import Any

from slipd_client.live_view import LiveView
from slipd_client.terminal import Terminal

SLIP: dict[str, Any] = {
    "finger": "left",
    "level": "warning",
    "reasons": ["rotation", "tipping"],
    "normal_n": 10.125,
    "tangential_n": [-2.1, 2.8],
    "spin_nm": 0.0123,
    "mu": 0.6,
    "utilisation": 0.5,
    "utilisation_lower": 0.5,
    "utilisation_upper": 0.75,
    "grip_needed_n": 14.25,
    "timestamp": 1_700_000_000.25,
}
STREAM: dict[str, Any] = {
    "health": 1,
    "message": "3 bad frames",
    "expected_hz": 1000.0,
    "rate_hz": 998.4,
    "age_s": 0.0015,
    "bad": 3,
    "lost": 0,
    "reconnects": 2,
}
STATUS: dict[str, Any] = {
    "version": "0.1.0",
    "uptime_s": 75.0,
    "config_id": "3f2a",
    "fingers": {"left": {"level": "caution"}, "right": {"level": "unknown"}},
    "streams": {"left.wrench": STREAM},
    "lease": {"held": True, "expires_in_s": 0.1},
}
GRIPPER: dict[str, Any] = {
    "width_m": 0.0425,
    "force_command_n": 12.0,
    "force_limit_n": 40.0,
    "object": "contact_closing",
    "moving": False,
    "fault": "",
    "echo_ok": True,
}
PAD: dict[str, Any] = {
    "finger": "left",
    "rows": 8,
    "cols": 16,
    "pitch_m": 0.0032,
    "image_ok": True,
    "loads_n": [0.0] * 64 + [0.5] * 64,
}
RIG: dict[str, dict[str, Any]] = {
    "slip.left": SLIP | {"centroid_m": [0.0, 0.0064], "pole_m": [0.004, 0.2]},
    "slip.right": SLIP | {"finger": "right", "level": "slipping", "evidence": ["load_drop"]},
    "tactile.left": PAD,
    "tactile.right": PAD | {"finger": "right"},
    "gripper": GRIPPER,
    "status": STATUS
    | {
        "streams": {
            f"{f}.{s}": STREAM | {"health": 0, "message": ""} for f in ("left", "right") for s in ("wrench", "pad")
        }
    },
}


def drawn(width: int = 200, silent_s: float = 0.0, **bodies: dict[str, Any]) -> str:
    view = LiveView()
    for topic, body in bodies.items():
        view.update(topic.replace("_", "."), body)
    return "\n".join(view.render(Terminal(width), silent_s))


def rig(terminal: Terminal, silent_s: float = 0.0, **more: dict[str, Any]) -> list[str]:
    view = LiveView()
    for topic, body in (RIG | {key.replace("_", "."): body for key, body in more.items()}).items():
        view.update(topic, body)
    return view.render(terminal, silent_s)
