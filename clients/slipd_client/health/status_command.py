"""``slipctl status``: what needs a repair, then the state of every finger and stream."""

from __future__ import annotations

import json

from slipd_client.health.repairs import Repair, repairs
from slipd_client.live_view import LiveView
from slipd_client.live_view_format import plain
from slipd_client.messages import STATUS_TOPIC
from slipd_client.messages.schema.replies import StatusReply
from slipd_client.watch import print_view


def print_status(status: StatusReply, *, as_json: bool) -> None:
    """Print a reply; as JSON, it has the list of repairs beside the fields of the reply."""
    found = repairs(status)
    if as_json:
        print(json.dumps({**status, "repairs": [repair.as_map() for repair in found]}))
        return
    print(repairs_text(found))
    view = LiveView()
    view.update(STATUS_TOPIC, status)
    print_view(view)


def repairs_text(found: list[Repair]) -> str:
    """Return the list for people."""
    if not found:
        return "nothing to repair"
    lines = [f"{len(found)} to repair" if len(found) > 1 else "1 to repair"]
    for repair in found:
        lines.append(f"  {repair.severity:<7} {repair.id}  {plain(repair.about)}: {plain(repair.problem)}")
        lines.append(f"          {plain(repair.command)}   # {repair.link}")
    return "\n".join(lines)
