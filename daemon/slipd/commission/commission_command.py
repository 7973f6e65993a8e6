"""``slipd commission``: leads a person from a config with guesses to a first grasp, and writes what is found."""

from __future__ import annotations

from pathlib import Path

from slipd import config
from slipd.commission.commission_guide import commission
from slipd.commission.dialogue import follow
from slipd.commission.page_host import PageHost
from slipd.commission.terminal_host import TerminalHost
from slipd.errors import SlipdError
from slipd_client.errors import SlipdClientError

NEXT = """\
Next, with the daemon running the new config (docs/first_day.md):
  slipctl gravity, slipd identify    weigh the finger in a few poses
  slipctl friction {finger}             measure the friction
  slipctl grip close 10              first grasp"""


def commission_command(
    file: Path,
    fingers: list[str],
    publish: str | None,
    requests: str | None,
    patience_s: float,
    *,
    write: bool,
    page: bool = False,
) -> bool:
    """Lead a person through the steps, print what they show, and write it.

    Args:
        file: The config that the daemon runs.
        fingers: Names of the fingers; empty: all.
        publish: Where the daemon publishes; None: as the config states.
        requests: Where it accepts requests, likewise.
        patience_s: How long to wait for each touch, s.
        write: Write the config; else only print what would change.
        page: Speak with the page ``/commission`` of the live view, not with a person.

    Returns:
        Whether everything followed.

    Raises:
        ConfigError: The config has faults.
        SlipdError: A finger is unknown, the daemon is silent or runs another config, or nothing was touched.
    """
    rig = config.load(file)
    for name in fingers:
        if name not in rig.finger:
            raise SlipdError(f"--finger must be one of {', '.join(rig.finger)}, got {name!r:.40}")
    names = fingers or list(rig.finger)
    try:
        with (PageHost if page else TerminalHost)(
            file, rig.text, publish or rig.bus.publish, requests or rig.bus.requests, None, write=write
        ) as host:
            complete = follow(commission(rig, names, patience_s), host.respond)
    except SlipdClientError as error:
        raise SlipdError(str(error)) from error
    if complete and not page:
        print(NEXT.format(finger=names[0]), flush=True)
    return complete
