"""What describes the commands of ``slipctl`` and ``slipd``: their parser, and options and types that several have."""

from __future__ import annotations

import argparse
import difflib
import ipaddress
import math
import re
import socket
import sys
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NoReturn

from slipd_client.paths import publish_endpoint, requests_endpoint

Add = Callable[[Any], object]
"""Adds arguments to a parser, or to a group of one."""

DEFAULT_LISTEN = "127.0.0.1:8710"

FLEET_NAME = r"[A-Za-z0-9][A-Za-z0-9_.-]{0,63}"
"""Name of a fleet or a robot, which is part of a key of Zenoh."""

_LISTEN = re.compile(r"(?P<host>\[[0-9A-Fa-f:.]+\]|[^:\[\]\s]+):(?P<port>\d{1,5})")
_HOST = re.compile(r"(?P<host>\[[0-9A-Fa-f:.]+\]|[^:\[\]\s/@]+)(:\d{1,5})?")


@dataclass(frozen=True)
class ListenAddress:
    """An address of this machine, and a port on it.

    Attributes:
        host: A name or an IP address, without brackets.
        port: The port; 0 is any that is free.
    """

    host: str
    port: int

    @property
    def loopback(self) -> bool:
        """Only programs on this machine can connect."""
        literal = _ip(self.host)
        return self.host == "localhost" if literal is None else literal.is_loopback

    def url(self, port: int) -> str:
        """Return the address for a browser, with the port in use."""
        literal = _ip(self.host)
        host = self.host if literal is None or not literal.is_unspecified else socket.gethostname()
        return f"http://[{host}]:{port}/" if ":" in host else f"http://{host}:{port}/"

    def allows(self, host_header: str) -> bool:
        """Return whether a browser may use this ``Host``: an IP address, or a name of this machine.

        A page of another site can point a name of its own at this machine (DNS rebinding), but neither an IP address
        nor a name of the machine.
        """
        found = _HOST.fullmatch(host_header)
        if found is None:
            return False
        host = found["host"].strip("[]").lower()
        own = socket.gethostname().lower()
        return _ip(host) is not None or host in ("localhost", self.host.lower(), own, f"{own}.local")


def parse_listen(text: str) -> ListenAddress:
    """Return the address that ``HOST:PORT`` names.

    Raises:
        argparse.ArgumentTypeError: It is not an address with a port.
    """
    found = _LISTEN.fullmatch(text)
    if found is None or int(found["port"]) > 65535:
        raise argparse.ArgumentTypeError(f"must be HOST:PORT, e.g. {DEFAULT_LISTEN}, got {text!r:.80}")
    return ListenAddress(found["host"].strip("[]"), int(found["port"]))


@dataclass(frozen=True, slots=True)
class Command:
    """A command.

    Attributes:
        name: Its words.
        run: What carries it out, "module:function"; "" for a list of commands.
        purpose: What it does, for the list of commands.
        arguments: What it takes, in the order of its help.
        more: What stands at the end of its help.
        given: More that its parsed arguments have.
    """

    name: str
    run: str
    purpose: str
    arguments: Sequence[Add] = ()
    more: str = ""
    given: Mapping[str, Any] = field(default_factory=dict)


def argument(*names: str, **given: Any) -> Add:
    """Return what adds an argument; names and properties are those of ``add_argument`` of argparse."""

    def add(to: Any) -> None:
        to.add_argument(*names, **given)

    return add


def one_of(*arguments: Add, required: bool = False) -> Add:
    """Return what adds arguments of which one may be given, or must be."""

    def add(to: Any) -> None:
        group = to.add_mutually_exclusive_group(required=required)
        for each in arguments:
            each(group)

    return add


class CommandParser(argparse.ArgumentParser):
    """A parser of commands.

    Attributes:
        names: The commands below it.
        default: The one of them that may be left out; "" where every command must be named.
        elsewhere: Another program, and the commands that it alone has, for those who mistake one for the other.
    """

    names: Collection[str] = ()
    default = ""
    elsewhere: tuple[str, Collection[str]] = ("", ())

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Put the default before arguments that begin with no command and no option; refuse surplus ones itself."""
        args = sys.argv[1:] if args is None else args
        if self.names and args and not args[0].startswith("-") and args[0] not in self.names:
            if not self.default:
                self.refuse(args)
            args = [self.default, *args]
        found, surplus = super().parse_known_args(args, namespace)
        if surplus:
            self.error(f"unrecognized arguments: {' '.join(surplus)}")
        return found, surplus

    def refuse(self, words: Sequence[str] = ()) -> NoReturn:
        """Exit with the list of commands, with the one that was probably meant, or with the program that has it."""
        typed, (program, others) = words[0] if words else "", self.elsewhere
        if typed in others:
            self.exit(2, f"{self.prog}: {typed} is a command of {program}: {' '.join([program, *words])}\n")
        if near := difflib.get_close_matches(typed, [*self.names, *others], n=1):
            self.error(f"there is no command {typed!r}; did you mean {near[0]!r}?")
        self.error(f"COMMAND must be one of {', '.join(self.names)}" + (f", got {typed!r:.80}" if typed else ""))


def add_commands(top: CommandParser, commands: Sequence[Command]) -> dict[str, CommandParser]:
    """Add commands to a parser, each below the command whose name begins its own; return the parser of each."""
    parsers: dict[str, CommandParser] = {"": top}
    lists: dict[str, Any] = {}
    for each in commands:
        above, _, word = each.name.rpartition(" ")
        if above not in lists:
            words = (name for start, _, name in (other.name.rpartition(" ") for other in commands) if start == above)
            metavar = "|".join(words) if above else "COMMAND"
            lists[above] = parsers[above].add_subparsers(title="commands", metavar=metavar, required=bool(above))
            parsers[above].names = lists[above].choices
        purpose = f"{each.purpose[0].upper()}{each.purpose[1:]}."
        parsers[each.name] = lists[above].add_parser(word, help=each.purpose, description=purpose, epilog=each.more)
        parsers[each.name].set_defaults(command=each.name, run=each.run, **each.given)
        for add in each.arguments:
            add(parsers[each.name])
    return parsers


def add_connection(command: argparse.ArgumentParser, default: str | None) -> None:
    """Add the options of the connection, which may stand before and after a command."""
    group = command.add_argument_group("connection")
    for name, what, where in (
        ("--publish", "endpoint on which slipd publishes", publish_endpoint()),
        ("--requests", "endpoint on which slipd accepts requests", requests_endpoint()),
    ):
        group.add_argument(name, metavar="ENDPOINT", default=default, help=f"{what} (default: {escaped(where)})")
    group.add_argument(
        "--key", metavar="FILE", default=default, help="secret key of this client, for a daemon across a network"
    )
    group.add_argument("--server-key", metavar="FILE", default=default, help="public key of the daemon")


def escaped(text: str) -> str:
    """Return a text as argparse wants it in a help text."""
    return text.replace("%", "%%")


def finite(text: str) -> float:
    """Return a finite number."""
    try:
        value = float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"must be a number, got {text!r:.80}") from None
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f"must be finite, got {text}")
    return value


def matching(pattern: str, rule: str) -> Callable[[str], str]:
    """Return a type of arguments: a text that matches a pattern; ``rule`` says after "must" what it must be."""

    def parse(text: str) -> str:
        if not re.fullmatch(pattern, text):
            raise argparse.ArgumentTypeError(f"must {rule}, got {text!r:.80}")
        return text

    return parse


def number_in(rule: str, allows: Callable[[float], bool]) -> Callable[[str], float]:
    """Return a type of arguments: a number that is allowed; ``rule`` says in words which are."""

    def parse(text: str) -> float:
        value = finite(text)
        if not allows(value):
            raise argparse.ArgumentTypeError(f"must be {rule}, got {text}")
        return value

    return parse


fleet_name = matching(FLEET_NAME, "be 1 to 64 of the characters A-Z a-z 0-9 _ . - and begin with a letter or digit")
"""Type of arguments that are names of fleets and robots."""

JSON = argument("--json", action="store_true", help="print one JSON document")

LISTEN = argument(
    "--listen",
    type=parse_listen,
    default=DEFAULT_LISTEN,
    metavar="HOST:PORT",
    help="where to serve the page (default: %(default)s; port 0: any free one)",
)

rate_hz = number_in("from 0.001 to 1e6 Hz", lambda hz: 0.001 <= hz <= 1e6)
"""Type of arguments that are rates."""


def _ip(host: str) -> ipaddress.IPv4Address | ipaddress.IPv6Address | None:
    try:
        return ipaddress.ip_address(host)
    except ValueError:
        return None
