"""``slipctl status``: what needs a repair, then the state of every finger and stream."""

from __future__ import annotations

import json
import sys
import textwrap

from slipd_client.health.repairs import DOCUMENT, Repair, repairs
from slipd_client.live_view import LiveView
from slipd_client.live_view_format import plain
from slipd_client.messages import STATUS_TOPIC
from slipd_client.messages.schema.replies import StatusReply
from slipd_client.output_terminal import size_of
from slipd_client.watch import print_view

WIDEST = 100
"""Columns of the longest line for people, on a wide terminal and in a file."""


def print_status(status: StatusReply, *, as_json: bool) -> None:
    """Print a reply; as JSON, it has the list of repairs beside the fields of the reply."""
    found = repairs(status)
    if as_json:
        print(json.dumps({**status, "repairs": [repair.as_map() for repair in found]}))
        return
    columns = min(size_of(sys.stdout).columns, WIDEST)
    print(repairs_text(found, columns))
    view = LiveView()
    view.update(STATUS_TOPIC, status)
    print_view(view, columns)


def repairs_text(found: list[Repair], columns: int = WIDEST) -> str:
    """Return the list for people; only a word or a command that is longer makes a line longer than ``columns``."""
    if not found:
        return "nothing to repair"
    lines = [f"{len(found)} to repair" if len(found) > 1 else "1 to repair"]
    for repair in found:
        text = f"{repair.severity:<7} {repair.id}  {plain(repair.about)}: {plain(repair.problem)}"
        lines += textwrap.wrap(text, columns, initial_indent="  ", subsequent_indent=" " * 10, break_long_words=False)
        lines.append(f"          {plain(repair.command)}")
    return "\n".join([*lines, f"each is explained in {DOCUMENT}, under its id: slipd docs health"])
