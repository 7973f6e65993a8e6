"""``slipd demo``: the virtual gripper, the daemon and a robot program, each a process or thread of its own.

Nothing is simulated between them: the daemon reads pseudo-terminals, the program sends its requests over ZeroMQ, and
the live view is that of a subscriber. At the end a summary compares the reports with the truth.
"""

from __future__ import annotations

import contextlib
import json
import os
import select
import signal
import subprocess
import sys
import tempfile
import termios
import threading
import time
import tty
import webbrowser
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, nullcontext
from pathlib import Path
from typing import IO, Any, cast

from slipd.errors import SlipdError, UsageError
from slipd.recording.mcap_file import check_new
from slipd.tools.demo_summary import Tally, print_summary
from slipd.tools.shipped_files import shipped_config
from slipd.tools.sim.carry import CarryProgram, carry_config
from slipd.tools.sim.robot_program import LISTEN_S, RobotProgram
from slipd_client.page.page_server import redirect_file
from slipd_client.subscriber import Subscriber
from slipd_client.watch import Display

PATIENCE_S = 60.0
"""Longest start of a part, s."""

END_S = 5.0
"""Longest end of a part after a request to end, s."""


def run_demo(
    seconds: float | None, scene: str, *, headless: bool, seed: int, record: Path | None, without_advice: bool
) -> bool:
    """Run the demo to its end, or for ``seconds``, and print a summary.

    On a terminal, without ``seconds``, the daemon and its page stay afterwards, and a key plays the scene again.
    In the scene "carry" a robot arm carries a glass whose grip may not rise, as fast as slipd says, or at full speed
    ``without_advice``; in "pour" something is poured into a box.

    Returns:
        Whether the scene ran and the daemon ended in good order.

    Raises:
        UsageError: The options do not go together.
        RecordingError: The recording cannot be created.
    """
    if without_advice and scene != "carry":
        raise UsageError("--without-advice is for --scene carry")
    if record is not None:
        check_new(record)
    stays = seconds is None and not headless
    with tempfile.TemporaryDirectory(prefix="slipd-demo-") as name, _ended_by_signals(), ExitStack() as page:
        _compile_kernels()
        play = _Play(
            Path(name),
            seconds,
            page,
            headless=headless,
            seed=seed,
            carry=scene == "carry",
            advised=not without_advice,
        )
        recording: tuple[str, ...] = () if record is None else ("--record", str(record))
        while play.run(recording, stays=stays):
            recording = ()  # it is complete
    return play.well


class _Play:
    """Plays the scene, each time with new parts; the page of the live view stays.

    Args:
        folder: For ports and logs.
        seconds: When it ends, s; None: with the scene.
        page: Ends the page.
        headless: Print only the summary.
        seed: Seed of the noise.
        carry: The arm carries a glass.
        advised: The arm asks slipd how fast it may go.

    Attributes:
        well: The daemon and the robot program ended in good order so far.
    """

    def __init__(
        self, folder: Path, seconds: float | None, page: ExitStack, *,
        headless: bool, seed: int, carry: bool, advised: bool,
    ) -> None:  # fmt: skip
        self.well = True
        self._carry, self._advised = carry, advised
        self._folder, self._seconds, self._page, self._headless, self._seed = folder, seconds, page, headless, seed
        self._plays = 0
        self._url = ""

    def run(self, recording: Sequence[str], *, stays: bool) -> bool:
        """Play the scene once; return whether to play it again."""
        self._plays += 1
        ports = self._folder / str(self._plays)
        ports.mkdir()
        gripper_log, daemon_log = ports / "virtual gripper.log", ports / "daemon.log"
        seed = ("--seed", str(self._seed), *(("--carry",) if self._carry else ()))
        again = False
        with (
            _part("slipd.tools.sim.virtual_gripper", gripper_log, "--dir", str(ports), *seed) as gripper,
            _part("slipd", daemon_log, "run", str(_rig_file(ports, carry=self._carry)), *recording) as daemon,
        ):
            _first_lines(gripper, 1, gripper_log)
            publish, requests = (line.split(": ", 1)[1].strip() for line in _first_lines(daemon, 2, daemon_log))
            if self._plays == 1:
                print(f"publish: {publish}\nrequests: {requests}", flush=True)
            if self._plays == 1 and not self._headless:
                self._url = self._page.enter_context(_page(self._folder, publish, requests))
            truth = _collect(gripper)
            program = self._program(publish, requests, gripper, truth)
            program.start()
            tally, whole = _watch(publish, program, daemon, self._seconds, headless=self._headless)
            program.end()
            program.join(END_S)
            kept = stays and whole and daemon.poll() is None and _has_person()
            if kept:
                print_summary(tally, program.report, truth)
                print(f"\nThe page stays open, and the daemon runs on: {self._url}")
                again = _waits_for_key(daemon)
        if not kept:
            print_summary(tally, program.report, truth)
        if daemon.returncode != 0 or program.report.error:
            self.well = False
            print(f"exit code of the daemon: {daemon.returncode}; its log:", file=sys.stderr)
            print(daemon_log.read_text(encoding="utf-8"), file=sys.stderr)
        return again

    def _program(
        self, publish: str, requests: str, gripper: subprocess.Popen[str], truth: list[dict[str, Any]]
    ) -> RobotProgram:
        if not self._carry:
            return RobotProgram(publish, requests)

        def move(scale: float) -> None:
            print(scale, file=gripper.stdin, flush=True)

        def arrived() -> int:
            return sum(event["event"] == "arrived" for event in truth)

        return CarryProgram(publish, requests, move, arrived, advised=self._advised)


def _has_person() -> bool:
    """Return whether somebody at a terminal can press a key for this program."""
    return sys.stdin.isatty() and sys.stdout.isatty() and os.tcgetpgrp(sys.stdin.fileno()) == os.getpgrp()


def _waits_for_key(daemon: subprocess.Popen[str]) -> bool:
    """Leave everything open until a key is pressed; return whether it plays the scene again."""
    print("Any key plays the scene again; q ends the demo.", flush=True)
    terminal = sys.stdin.fileno()
    before = termios.tcgetattr(terminal)
    tty.setcbreak(terminal)
    try:
        while daemon.poll() is None:
            if select.select([terminal], [], [], LISTEN_S)[0]:
                return os.read(terminal, 1) not in (b"q", b"\x04", b"")
    finally:
        termios.tcsetattr(terminal, termios.TCSADRAIN, before)
    return False


def _compile_kernels() -> None:
    """Let another process fill Numba's cache, with the progress on this terminal, where the daemon's log is not.

    Ctrl-C reaches only the demo, which ends that process: the imports of Numba would print their traceback.
    """
    command = [sys.executable, "-m", "slipd.compile_kernels"]
    if subprocess.run(command, check=False, start_new_session=True).returncode:  # noqa: S603 - our own program
        raise SlipdError("the kernels cannot be compiled")


def _rig_file(ports: Path, *, carry: bool) -> Path:
    """Write the config of the scene with the ports of this run, and return its path."""
    text = shipped_config("demo.toml").read_text(encoding="utf-8")
    text = carry_config(text) if carry else text
    rig = ports / "demo.toml"
    rig.write_text(text.replace('"virtual/', f'"{ports}/').replace("//virtual/", f"//{ports}/"), encoding="utf-8")
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
def _page(folder: Path, publish: str, requests: str) -> Iterator[str]:
    """Serve the live view for a browser, print its address, open it where there is a display, and yield it."""
    log = folder / "view.log"
    endpoints = ("--publish", publish, "--requests", requests)
    with _part("slipd_client.slipctl", log, *endpoints, "view", "--listen", "127.0.0.1:0") as view:
        (line,) = _first_lines(view, 1, log)
        print(line, end="", flush=True)
        url = line.split(": ", 1)[1].strip()
        if os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"):
            with contextlib.suppress(webbrowser.Error):
                webbrowser.open(redirect_file(folder, url).as_uri())
        yield url


def _first_lines(process: subprocess.Popen[str], count: int, log: Path) -> list[str]:
    """Return the first lines that a part prints once it is ready.

    Raises:
        SlipdError: The part ended or was not ready in time; the text contains its log.
    """
    timer = threading.Timer(PATIENCE_S, process.kill)
    timer.start()
    try:
        lines = [cast("IO[str]", process.stdout).readline() for _ in range(count)]
    finally:
        timer.cancel()
    if not all(lines):
        logged = log.read_text(encoding="utf-8").strip()
        raise SlipdError(f"{log.stem} did not start: {logged or 'it printed nothing'}")
    return lines


def _collect(process: subprocess.Popen[str]) -> list[dict[str, Any]]:
    """Return a list that grows with the events that the virtual gripper reports."""
    truth: list[dict[str, Any]] = []
    lines = cast("IO[str]", process.stdout)
    threading.Thread(target=lambda: truth.extend(map(json.loads, lines)), name="truth", daemon=True).start()
    return truth


def _watch(
    publish: str, program: RobotProgram, daemon: subprocess.Popen[str], seconds: float | None, *, headless: bool
) -> tuple[Tally, bool]:
    """Receive every message until the robot program ends, the time is over, or Ctrl-C.

    Returns:
        Counts of the messages, and whether it was not ended by Ctrl-C.
    """
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
        return tally, False
    return tally, True
