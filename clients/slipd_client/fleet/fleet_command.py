"""``slipctl fleet``: every robot of a fleet on a terminal, in a log or as JSON, until interrupted."""

from __future__ import annotations

import argparse
import contextlib
import json
import math
import sys
import time
from collections.abc import Iterator

from slipd_client.errors import require
from slipd_client.fleet.fleet_listener import FleetListener
from slipd_client.fleet.fleet_state import RobotRow
from slipd_client.fleet.fleet_view import change_text, fleet_lines, fleet_map
from slipd_client.fleet.zenoh_session import Reach, configuration, described, opened
from slipd_client.live_view import UNCUT
from slipd_client.live_view_format import clock_time
from slipd_client.output_terminal import ascii_only, is_screen, size_of, terminal_of
from slipd_client.terminal_screen import TerminalScreen
from slipd_client.terminal_text import spelled

GATHER_S = 2.5
"""How long ``--once`` gathers, s: by then every robot that can has sent its last values or a new ``status``."""

ROUTER_S = 10.0
"""How long ``--once`` waits for a router, s: a script must not hang."""

REDRAW_S = 0.2
LINE_S = 1.0


def run(chosen: argparse.Namespace) -> None:
    """Carry out the command.

    Raises:
        CallError: An argument is wrong, or Zenoh or the page cannot start.
        ClientError: With ``--once``, there was no router for ``ROUTER_S``.
    """
    with _listening(chosen) as listener:
        if chosen.page is not None:
            _serve_page(chosen, listener)
        elif chosen.once:
            _take(listener, GATHER_S)
            _print_once(chosen, listener)
        elif chosen.json:
            while True:
                _take(listener, LINE_S)
                print(json.dumps(fleet_map(chosen.fleet, _rows(listener), _unread(listener))), flush=True)
        elif is_screen(sys.stdout):
            _redraw(chosen.fleet, listener)
        else:
            _print_changes(listener)


@contextlib.contextmanager
def _listening(chosen: argparse.Namespace) -> Iterator[FleetListener]:
    """Listen to the fleet while the block runs."""
    reach = Reach(chosen.connect, chosen.listen, chosen.zenoh_config)
    wait_s = ROUTER_S if chosen.once else math.inf
    with opened(configuration(reach, "router"), described(reach), wait_s) as session:
        yield FleetListener(session, chosen.fleet, chosen.robots)


def _take(listener: FleetListener, seconds: float) -> None:
    """Take what arrives within some seconds."""
    until_s = time.monotonic() + seconds
    while (left_s := until_s - time.monotonic()) > 0:
        listener.take(left_s)


def _print_once(chosen: argparse.Namespace, listener: FleetListener) -> None:
    rows = _rows(listener)
    if chosen.json:
        print(json.dumps(fleet_map(chosen.fleet, rows, _unread(listener))))
        return
    terminal = terminal_of(sys.stdout, size_of(sys.stdout).columns, UNCUT)
    for line in fleet_lines(chosen.fleet, rows, _unread(listener), terminal):
        print(line)


def _redraw(fleet: str, listener: FleetListener) -> None:
    with TerminalScreen(sys.stdout) as screen:
        while True:
            size = size_of(sys.stdout)
            terminal = terminal_of(sys.stdout, *size)
            screen.draw(fleet_lines(fleet, _rows(listener), _unread(listener), terminal), size)
            _take(listener, REDRAW_S)


def _print_changes(listener: FleetListener) -> None:
    """Print a line for each change of a robot."""
    before: dict[str, RobotRow] = {}
    while True:
        _take(listener, REDRAW_S)
        for row in _rows(listener):
            if text := change_text(before.get(row.robot), row):
                print(spelled(f"{clock_time(time.time())}  {text}", ascii_only=ascii_only(sys.stdout)), flush=True)
            before[row.robot] = row


def _rows(listener: FleetListener) -> list[RobotRow]:
    return listener.state.rows(time.monotonic())


def _unread(listener: FleetListener) -> int:
    return listener.state.unread


def _serve_page(chosen: argparse.Namespace, listener: FleetListener) -> None:
    require("websockets", "websockets", "slipctl fleet --page")
    from slipd_client.fleet import fleet_page  # here: only the page needs the extra `view`

    fleet_page.serve(chosen.fleet, listener, chosen.page)
