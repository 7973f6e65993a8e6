"""``slipd demo``: the virtual gripper, the daemon and a robot program, each a process or thread of its own.

Nothing is simulated between them: the daemon reads pseudo-terminals, the program sends its requests over ZeroMQ, and
the live view is that of a subscriber. At the end a summary compares the reports with the truth.
"""

from __future__ import annotations

import contextlib
import json
import os
import signal
import statistics
import subprocess
import sys
import tempfile
import threading
import time
import webbrowser
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any

from slipd import config
from slipd.errors import SlipdError
from slipd.sim.robot_program import RobotProgram
from slipd.sim.robot_report import Report
from slipd_client.errors import ClientError
from slipd_client.grip import GripClient
from slipd_client.page.redirect import redirect_file
from slipd_client.subscriber import Message, Subscriber
from slipd_client.watch import Display

PATIENCE_S = 60.0
"""Longest start of a part, s."""

END_S = 5.0
"""Longest end of a part after a request to end, s."""

LISTEN_S = 0.05

FINAL_LOOKS = 3
"""Times that the status is asked for at the end: on a busy machine a request may come too late."""


@dataclass(slots=True)
class Tally:
    """Counts of a subscriber of every topic.

    Attributes:
        messages: Number of messages of each kind of topic.
        missed: Number of messages that did not arrive.
        latencies_s: Time from the last byte of a reading to its message in this process, s.
    """

    messages: Counter[str] = field(default_factory=Counter)
    missed: int = 0
    latencies_s: list[float] = field(default_factory=list)

    def add(self, message: Message) -> None:
        """Count one message."""
        self.messages[message.topic.partition(".")[0]] += 1
        self.missed += message.missed
        if message.topic.startswith("slip."):
            self.latencies_s.append(message.age_s)


def run_demo(seconds: float | None, *, headless: bool, seed: int, record: Path | None) -> int:
    """Run the demo to its end, or for ``seconds``, and print a summary.

    Returns:
        Exit code: 0 if the scene ran and the daemon ended in good order.
    """
    with tempfile.TemporaryDirectory(prefix="slipd-demo-") as name:
        ports = Path(name)
        recording = () if record is None else ("--record", str(record))
        with _ended_by_signals():
            _compile_kernels()
        gripper_log, daemon_log = ports / "virtual gripper.log", ports / "daemon.log"
        with (
            _ended_by_signals(),
            _part("slipd.sim.virtual_gripper", gripper_log, "--dir", name, "--seed", str(seed)) as gripper,
            _part("slipd", daemon_log, "run", str(_rig_file(ports)), *recording) as daemon,
        ):
            _first_lines(gripper, 1, gripper_log)
            publish, requests = (line.split(": ", 1)[1].strip() for line in _first_lines(daemon, 2, daemon_log))
            print(f"publish: {publish}\nrequests: {requests}", flush=True)
            truth = _collect(gripper)
            program = RobotProgram(publish, requests)
            with contextlib.nullcontext() if headless else _page(ports, publish, requests):
                program.start()
                tally = _watch(publish, program, daemon, seconds, headless=headless)
                program.end()
                program.join(END_S)
            streams = _final_streams(requests) if daemon.poll() is None else {}
        _summary(tally, program.report, truth, streams)
        if daemon.returncode != 0 or program.report.error:
            log = daemon_log.read_text(encoding="utf-8")
            print(f"exit code of the daemon: {daemon.returncode}; its log:\n{log}", file=sys.stderr)
    return 1 if program.report.error or daemon.returncode != 0 else 0


def _compile_kernels() -> None:
    """Let another process fill Numba's cache, with the progress on this terminal, where the daemon's log is not."""
    command = [sys.executable, "-m", "slipd.compile_kernels"]
    if subprocess.run(command, check=False).returncode:  # noqa: S603 - our own program
        raise SlipdError("the kernels cannot be compiled")


def _rig_file(ports: Path) -> Path:
    """Write the shipped demo config with the ports of this run, and return its path."""
    text = config.shipped("demo.toml").read_text(encoding="utf-8")
    rig = ports / "demo.toml"
    rig.write_text(text.replace('"virtual/', f'"{ports}/'), encoding="utf-8")
    return rig


@contextmanager
def _ended_by_signals() -> Iterator[None]:
    """Treat SIGTERM and SIGHUP like Ctrl-C, so that no part keeps running with an open recording."""
    numbers = [number for number in (signal.SIGTERM, signal.SIGHUP) if signal.getsignal(number) is signal.SIG_DFL]
    for number in numbers:
        signal.signal(number, signal.default_int_handler)
    try:
        yield
    finally:
        for number in numbers:
            signal.signal(number, signal.SIG_DFL)


@contextmanager
def _part(name: str, log: Path, *arguments: str) -> Iterator[subprocess.Popen[str]]:
    """Start a part with its log in a file, and end it in every case. Ctrl-C reaches only the demo itself."""
    command = [sys.executable, "-m", name, *arguments]
    with log.open("w", encoding="utf-8") as stderr:
        process = subprocess.Popen(  # noqa: S603 - our own programs
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=stderr, text=True, start_new_session=True
        )
    with process:
        try:
            yield process
        finally:
            process.terminate()
            try:
                process.wait(END_S)
            except subprocess.TimeoutExpired:
                process.kill()


@contextmanager
def _page(ports: Path, publish: str, requests: str) -> Iterator[None]:
    """Serve the live view for a browser, print its address, and open it where there is a display."""
    log = ports / "view.log"
    endpoints = ("--publish", publish, "--requests", requests)
    with _part("slipd_client.slipctl", log, *endpoints, "view", "--listen", "127.0.0.1:0") as view:
        (line,) = _first_lines(view, 1, log)
        print(line, end="", flush=True)
        if os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"):
            with contextlib.suppress(webbrowser.Error):
                webbrowser.open(redirect_file(ports, line.split(": ", 1)[1].strip()).as_uri())
        yield


def _first_lines(process: subprocess.Popen[str], count: int, log: Path) -> list[str]:
    """Return the first lines that a part prints once it is ready.

    Raises:
        SlipdError: The part ended or was not ready in time; the text contains its log.
    """
    timer = threading.Timer(PATIENCE_S, process.kill)
    timer.start()
    try:
        lines = [_pipe(process.stdout).readline() for _ in range(count)]
    finally:
        timer.cancel()
    if not all(lines):
        logged = log.read_text(encoding="utf-8").strip()
        raise SlipdError(f"{log.stem} did not start: {logged or 'it printed nothing'}")
    return lines


def _collect(process: subprocess.Popen[str]) -> list[dict[str, Any]]:
    """Return a list that grows with the events that the virtual gripper reports."""
    truth: list[dict[str, Any]] = []
    stdout = _pipe(process.stdout)
    threading.Thread(target=lambda: truth.extend(map(json.loads, stdout)), name="truth", daemon=True).start()
    return truth


def _watch(
    publish: str, program: RobotProgram, daemon: subprocess.Popen[str], seconds: float | None, *, headless: bool
) -> Tally:
    """Receive every message until the robot program ends, the time is over, or Ctrl-C."""
    tally = Tally()
    until_s = None if seconds is None else time.monotonic() + seconds
    try:
        with Subscriber(publish, ("",)) as subscriber, nullcontext() if headless else Display() as display:
            while daemon.poll() is None and (program.is_alive() if until_s is None else time.monotonic() < until_s):
                message = subscriber.receive(LISTEN_S)
                if message is not None:
                    tally.add(message)
                if display is not None:
                    if message is not None:
                        display.add(message)
                    display.refresh(subscriber.age_s or 0.0)
    except KeyboardInterrupt:
        print()
    return tally


def _final_streams(requests: str) -> dict[str, dict[str, Any]]:
    """Return the streams of the daemon's status; nothing where it refuses or does not answer."""
    error: ClientError | None = None
    with GripClient(requests) as requester:
        for _ in range(FINAL_LOOKS):
            try:
                streams: dict[str, dict[str, Any]] = requester.status()["streams"]
            except ClientError as failed:
                error = failed
            else:
                return streams
    print(f"the daemon does not report its status at the end: {error}", file=sys.stderr)
    return {}


def _summary(tally: Tally, report: Report, truth: list[dict[str, Any]], streams: dict[str, dict[str, Any]]) -> None:
    begin = next((event["t_ns"] for event in truth if event["event"] == "begin"), report.activated_ns)

    def at(t_ns: int) -> str:
        return f"{(t_ns - begin) * 1e-9:6.2f} s" if begin is not None else "     ? s"

    print("\nThe scene, and what slipd reported:")
    lines = [(event["t_ns"], f"truth    {_truth_line(event)}") for event in truth if event.get("t_s") is not None]
    lines += [
        (c.t_ns, f"slipd    {c.finger}: {c.level} ({', '.join(c.reasons) or 'no reasons'})") for c in report.changes
    ]
    for r in report.raises:
        applied = f"granted {r.result['applied_n']:.1f} N" if r.result else f"refused: {r.refusal}"
        measured = f"; measured {_n(r.before_n)} → {_n(r.after_n)}"
        lines.append((r.requested_ns, f"program  requests {r.requested_n:.1f} N on each pad: {applied}{measured}"))
    for t_ns, line in sorted(lines):
        print(f"  {at(t_ns)}  {line}")
    for line in _verdict_lines(report, truth):
        print(line)
    lost = sum(stream["lost"] for stream in streams.values())
    bad = sum(stream["bad"] for stream in streams.values())
    latency = statistics.median(tally.latencies_s) * 1e3 if tally.latencies_s else float("nan")
    print(f"readings: {sum(stream['samples'] for stream in streams.values())} ({bad} bad, {lost} lost)")
    counts = ", ".join(f"{count} {kind}" for kind, count in sorted(tally.messages.items()))
    print(f"messages: {tally.messages.total()} ({counts})")
    alarms = sum(change.rising and change.level in ("warning", "slipping") for change in report.changes)
    unknowns = sum(change.level == "unknown" for change in report.changes)
    print(f"warnings: {alarms} (unknown: {unknowns}; changes of level: {len(report.changes)})")
    print(f"gaps: {tally.missed}")
    print(f"median latency: {latency:.2f} ms from the last byte of a reading to its message here")
    if report.error:
        print(f"the robot program ended early: {report.error}", file=sys.stderr)


def _verdict_lines(report: Report, truth: list[dict[str, Any]]) -> Iterator[str]:
    warned = report.rotation_warning
    forecast = next((event["rotation_would_begin_s"] for event in truth if event.get("rotation_would_begin_s")), None)
    begin = next((event["t_ns"] for event in truth if event["event"] == "begin"), None)
    if warned is not None and forecast is not None and begin is not None:
        lead = forecast - (warned.t_ns - begin) * 1e-9
        yield f"rotation: warned {lead:.2f} s before it would have begun at the first grip force"
    slid = next((event["t_ns"] for event in truth if event["event"] == "slide_begins"), None)
    reported = report.slip_report
    if slid is not None and reported is not None:
        yield f"slip: reported {(reported.t_ns - slid) * 1e-6:.0f} ms after it began"


def _truth_line(event: dict[str, Any]) -> str:
    values = {key: value for key, value in event.items() if key not in ("t_s", "t_ns", "event") and value is not None}
    shown = ", ".join(
        f"{key} {value:.3g}" if isinstance(value, float) else f"{key} {value}" for key, value in values.items()
    )
    return f"{event['event']}" + (f" ({shown})" if shown else "")


def _n(force_n: float | None) -> str:
    return "unknown" if force_n is None else f"{force_n:.1f} N"


def _pipe(stream: IO[str] | None) -> IO[str]:
    if stream is None:
        raise ValueError("the process was started without a pipe")
    return stream
