"""``slipctl fleet``: every robot of a fleet on a terminal, in a log, as JSON or in a browser, until interrupted."""

from __future__ import annotations

import argparse
import asyncio
import json
import math
import sys
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from slipd_client.arguments import ListenAddress
from slipd_client.errors import require
from slipd_client.fleet.fleet_network import FleetListener, Reach, configuration, described, opened
from slipd_client.fleet.fleet_state import CLASH, GONE, LIVE, PUBLISHING, RobotRow
from slipd_client.keys import Keys
from slipd_client.live_view import HEALTH_COLOURS, LEVEL_COLOURS
from slipd_client.messages.names import SEVERITY
from slipd_client.terminal import (
    UNCUT,
    UNKNOWN,
    Line,
    Terminal,
    TerminalScreen,
    clock_time,
    is_screen,
    paint,
    plain,
    size_of,
    terminal_of,
)

NAME_CELLS = 16

_STATE_COLOURS = {LIVE: "32", GONE: "1;31", CLASH: "1;31"}


def by_urgency(rows: Sequence[RobotRow]) -> list[RobotRow]:
    """Return the robots that need attention first: alarms, then those not live, then ill ones, then by name.

    Robots that the user did not name follow those that he named: anyone may publish under a name.
    """
    return sorted(rows, key=lambda row: (not row.expected, -SEVERITY[row.level], -(row.health or 0), row.robot))


def fleet_lines(fleet: str, rows: Sequence[RobotRow], unread: int, terminal: Terminal) -> list[str]:
    """Return the view: a head with counts, then one line for each robot, the most urgent first.

    Args:
        fleet: Name of the fleet.
        rows: The robots.
        unread: Messages that could not be read.
        terminal: What to draw for; robots without room are counted in the last line.
    """
    head: list[Line] = [_summary(fleet, rows, unread)]
    if rows:
        head.append([(f"{'robot':<{NAME_CELLS}}  {'state':<6}  {'level':<10}  health  {'age':>8}", "2")])
    lines = [*head, *map(_robot_line, by_urgency(rows))]
    if len(lines) > terminal.lines:
        left_out = len(lines) - terminal.lines + 1
        less_urgent = ", all less urgent" if all(row.expected for row in rows) else ""
        lines = [*lines[: terminal.lines - 1], [(f"{left_out} more{less_urgent}", "2")]]
    return [paint(line, terminal.columns, colour=terminal.colour) for line in lines]


def fleet_map(fleet: str, rows: Sequence[RobotRow], unread: int) -> dict[str, Any]:
    """Return the fleet as a map of plain values, for JSON and the page."""
    robots = [
        asdict(row) | {"health": None if row.health is None else row.health.name, "remarks": _remarks(row)}
        for row in by_urgency(rows)
    ]
    return {"fleet": fleet, "robots": robots, "unread": unread}


def change_text(before: RobotRow | None, row: RobotRow) -> str:
    """Return one line for a log where state, level or health of a robot has changed; "" where it has not."""
    if before is None:
        return f"{row.robot}: {row.state}, {row.level}"
    parts = [
        f"{old} → {new}"
        for old, new in ((before.state, row.state), (before.level, row.level), (_health(before), _health(row)))
        if old != new
    ]
    why = _remarks(row)
    return f"{row.robot}: {', '.join(parts)}{f'  ({why})' if why else ''}" if parts else ""


def _summary(fleet: str, rows: Sequence[RobotRow], unread: int) -> Line:
    states = Counter(row.state for row in rows)
    levels = Counter(row.level for row in rows if row.state in PUBLISHING)
    text = f"fleet {fleet}  {len(rows)} {'robot' if len(rows) == 1 else 'robots'}"
    counts = [f"{states[state]} {state}" for state in sorted(states)]
    alarms = [f"{levels[level]} {level}" for level in ("slipping", "warning", "caution") if levels[level]]
    losses = ((sum(row.missed_warnings for row in rows), "warnings missed"), (unread, "messages not read"))
    more = [f"{count} {what}" for count, what in losses if count]
    return [("  ".join([text, *counts, *alarms, *more]), "1")]


def _robot_line(row: RobotRow) -> Line:
    age = UNKNOWN if row.age_s is None else f"{row.age_s:.1f} s"
    return [
        (f"{row.robot:<{NAME_CELLS}}", "1"),
        (f"  {row.state:<6}", _STATE_COLOURS.get(row.state, "33")),
        (f"  {row.level:<10}", LEVEL_COLOURS.get(row.level, "")),
        (f"  {_health(row):<6}", "" if row.health is None else HEALTH_COLOURS[row.health]),
        (f"  {age:>8}", ""),
        (f"  {text}" if (text := _remarks(row)) else "", ""),
    ]


def _health(row: RobotRow) -> str:
    return UNKNOWN if row.health is None else row.health.name


def _remarks(row: RobotRow) -> str:
    """Return what explains the row: its fault, levels of fingers now or at last, the worst stream, what is lost."""
    parts = [row.fault] if row.fault else []
    parts += [] if row.expected else ["not one of --robots"]
    if row.fingers:
        levels = ", ".join(f"{plain(finger)} {level}" for finger, level in row.fingers.items())
        parts.append(levels if row.state in PUBLISHING else f"last: {levels}")
    if row.state == LIVE and row.reasons:
        parts.append(", ".join(map(plain, row.reasons)))
    parts += [plain(row.complaint)] if row.complaint else []
    parts += [f"holds {plain(row.object_name)}"] if row.object_name else []
    parts += [f"{row.missed_warnings} warnings missed"] if row.missed_warnings else []
    return "; ".join(parts)


GATHER_S = 2.5
"""How long ``--once`` gathers, s: by then every robot that can has sent its last values or a new ``status``."""

ROUTER_S = 10.0
"""How long ``--once`` waits for a router, s: a script must not hang."""

REDRAW_S = 0.2
LINE_S = 1.0

TAKE_S = 0.1
"""Time between two updates of what the page gets, s."""

FLEET_DATA = "/data/fleet.json"


def run(chosen: argparse.Namespace, _: Keys | None) -> None:
    """Carry out the command; a fleet has no keys of ZeroMQ.

    Raises:
        CallError: An argument is wrong, or Zenoh or the page cannot start.
        ClientError: With ``--once``, there was no router for ``ROUTER_S``.
    """
    reach = Reach(chosen.connect, chosen.listen, chosen.zenoh_config)
    wait_s = ROUTER_S if chosen.once else math.inf
    with opened(configuration(reach, "router"), described(reach), wait_s) as session:
        listener = FleetListener(session, chosen.fleet, chosen.robots)
        if chosen.page is not None:
            require("websockets", "websockets", "slipctl fleet --page")
            asyncio.run(_serve_page(chosen.fleet, listener, chosen.page))
        elif chosen.once or chosen.json:
            _print(chosen, listener)
        elif is_screen(sys.stdout):
            _redraw(chosen.fleet, listener)
        else:
            _print_changes(listener)


def _rows(listener: FleetListener, seconds: float = 0.0) -> list[RobotRow]:
    """Take what arrives within some seconds, and return the robots."""
    until_s = time.monotonic() + seconds
    while (left_s := until_s - time.monotonic()) > 0:
        listener.receive(left_s)
    return listener.state.rows(time.monotonic())


def _print(chosen: argparse.Namespace, listener: FleetListener) -> None:
    """Print the fleet once a second as JSON, or once after a while."""
    while True:
        rows, unread = _rows(listener, GATHER_S if chosen.once else LINE_S), listener.state.unread
        if chosen.json:
            print(json.dumps(fleet_map(chosen.fleet, rows, unread)), flush=True)
        else:
            terminal = terminal_of(sys.stdout, size_of(sys.stdout).columns, UNCUT)
            print("\n".join(fleet_lines(chosen.fleet, rows, unread, terminal)))
        if chosen.once:
            return


def _redraw(fleet: str, listener: FleetListener) -> None:
    with TerminalScreen(sys.stdout) as screen:
        while True:
            rows, size = _rows(listener, REDRAW_S), size_of(sys.stdout)
            terminal = terminal_of(sys.stdout, *size)
            screen.draw(fleet_lines(fleet, rows, listener.state.unread, terminal), size)


def _print_changes(listener: FleetListener) -> None:
    """Print a line for each change of a robot."""
    before: dict[str, RobotRow] = {}
    while True:
        for row in _rows(listener, REDRAW_S):
            if text := change_text(before.get(row.robot), row):
                print(f"{clock_time(time.time())}  {text}", flush=True)
            before[row.robot] = row


async def _serve_page(fleet: str, listener: FleetListener, address: ListenAddress) -> None:
    """Serve the page of the fleet, which asks for the robots twice a second, and print its address."""
    from slipd_client.page.page_server import PageServer, json_answer  # here: only the page needs the extra `view`

    def robots() -> dict[str, Any]:
        return fleet_map(fleet, listener.state.rows(time.monotonic()), listener.state.unread)

    server = PageServer(
        address,
        {"live": True, "source": fleet},
        on_data=lambda path: json_answer(robots()) if path == FLEET_DATA else None,
        start="fleet.html",
    )
    async with server.serving() as url:
        print(f"fleet: {url}", flush=True)
        while True:
            listener.receive(0)
            await asyncio.sleep(TAKE_S)
