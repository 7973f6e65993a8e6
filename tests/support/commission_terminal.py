"""A person at the terminal of ``slipd commission``; rig, daemon and command are processes of their own."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, suppress
from pathlib import Path

from commission_person import PULLS, touch_for
from rig_parts import ENDS_S, emulating, first_line, part

from slipd.tools.sim.hand_commands import touch_command

ANSWERS = {
    "the fingertips point straight down": "tilt 1 0 0",
    "the left pad faces up": "tilt 0 0 -1",
    "the left pad faces down": "tilt 0 0 1",
    "+Y side of the left pad": "tilt 0 1 0",
    "The gripper is not active": "object 0 mm",
    "Hold a sample": "object 40 mm",
    "Put an object": "object 40 mm",
    "Then the gripper opens": "pull +x 0 N",
    "as soon as it can": "",
    "see to the cause": "pull +x 0 N",
    "See to the cause": "",
}
"""Words of a question, and what the person does before pressing Enter."""


class CommissionTerminal(ExitStack):
    """Follows the whole guide; ``with`` starts and ends the emulation and the daemon.

    Args:
        folder: For the files of all processes.
        true: Text of the config by which the devices are mounted.
        wrong: What the config of the daemon states in place of parts of it.
        touches: See `commission_person.TOUCHES`.

    Attributes:
        config: Of the daemon.
        lines: What the command printed.
    """

    def __init__(self, folder: Path, true: str, wrong: Mapping[str, str], touches: Mapping[str, str]) -> None:
        super().__init__()
        self._folder, self._true, self._wrong, self._touches = folder, true, wrong, touches
        self._hand = folder / "emulated"
        self.config = folder / "rig.toml"
        self.lines: list[str] = []

    def __enter__(self) -> CommissionTerminal:
        _, text = self.enter_context(emulating(self._folder, self._true))
        for right, other in self._wrong.items():
            assert right in text
            text = text.replace(right, other)
        self.config.write_text(text, encoding="utf-8")
        self._run_daemon()
        return self

    def follow(self, *options: str, until: str = "never") -> int:
        """Run the command, do what it asks for, press Ctrl-C at a line that begins so, and return the exit code."""
        master, slave = os.openpty()
        command = [sys.executable, "-m", "slipd", "commission", str(self.config), *options]
        environment = os.environ | {"SLIPD_RUNTIME_DIR": str(self._folder / "run")}
        with subprocess.Popen(
            command, stdin=slave, stdout=slave, stderr=slave, env=environment, start_new_session=True
        ) as process:
            os.close(slave)
            try:
                for line in _lines_of(master):
                    self.lines.append(line)
                    if line.startswith(until):
                        process.send_signal(signal.SIGINT)
                    else:
                        self._obey(line, master)
                return process.wait(ENDS_S)
            finally:
                os.close(master)
                process.kill()

    def _obey(self, line: str, master: int) -> None:
        """Do what a line asks for."""
        if "slipctl grip ack" in line:
            with part(self._folder, "slipd_client.slipctl", "grip", "ack") as ack:
                ack.wait(ENDS_S)
        if line.startswith("Now restart the daemon"):
            self._run_daemon()
        commands = [does for words, does in PULLS.items() if line.startswith(words)]
        touch = touch_for(line, self._touches)
        for command in commands or [touch] * (touch is not None):
            self._touch(command)
        if "[Enter: " in line:
            for words, does in ANSWERS.items():
                if words in line:
                    self._touch(does)
                    break
            loose = "see to the cause" in line and "nothing touches the pad" in self.lines[-2]
            os.write(master, b"close\n" if loose else b"\n")

    def _touch(self, line: str) -> None:
        if line:
            assert touch_command(self._hand, line.split())

    def _run_daemon(self) -> None:
        """Start the daemon, and end the one before as Ctrl-C does."""
        if self.lines:
            self._daemon.send_signal(signal.SIGINT)
            self._daemon.wait(ENDS_S)
        self._daemon = self.enter_context(part(self._folder, "slipd", "run", "--config", str(self.config)))
        first_line(self._daemon)


def _lines_of(master: int) -> Iterator[str]:
    """Yield the lines of a terminal until its last user has gone."""
    with suppress(OSError), os.fdopen(master, encoding="utf-8", closefd=False) as lines:
        yield from map(str.rstrip, lines)
