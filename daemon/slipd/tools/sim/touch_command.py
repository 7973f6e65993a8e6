"""``slipd touch``: sends commands to a running emulation. It loads nothing of the emulation, so it starts at once."""

from __future__ import annotations

import socket
import sys
from pathlib import Path

from slipd.errors import SlipdError

SOCKET = "hand"
"""Name of the local socket for commands."""

OK, ERROR, END = "ok", "error: ", "end"
"""First words of the last line of each answer on the socket."""


def touch_command(folder: Path, words: list[str]) -> bool:
    """Send commands to a running emulation and print the answers; without words, those of standard input.

    Returns:
        Whether every command was carried out.

    Raises:
        SlipdError: No emulation listens there.
    """
    done = True
    with socket.socket(socket.AF_UNIX) as line:
        try:
            line.connect(str(folder / SOCKET))
        except OSError as error:
            raise SlipdError(f"no emulation at {folder}: {error.strerror}; start one: slipd emulate CONFIG") from None
        with line.makefile("rw", encoding="utf-8") as both:
            for text in [" ".join(words)] if words else sys.stdin:
                both.write(text.rstrip("\n") + "\n")
                both.flush()
                for answer in both:
                    if answer.strip() == OK:
                        break
                    print(answer, end="", file=sys.stderr if answer.startswith(ERROR) else sys.stdout, flush=True)
                    if answer.startswith((ERROR, END)):
                        done = done and not answer.startswith(ERROR)
                        break
                else:
                    raise SlipdError("the emulation has ended")
    return done
