"""``slipd commission``: leads a person from a config with guesses to a first grasp, and writes what is found."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from slipd import config
from slipd.errors import SlipdError
from slipd.tools.commission.commission_guide import Commission
from slipd.tools.commission.daemon_link import link_to
from slipd.tools.commission.dialogue import follow
from slipd.tools.commission.hosts import PageHost, TerminalHost
from slipd_client.errors import SlipdClientError


def commission_command(
    file: Path, fingers: Sequence[str], first: str, patience_s: float, publish: str | None, requests: str | None,
    key: Path | None, server_key: Path | None, *, dry_run: bool, page: bool,
) -> bool:  # fmt: skip
    """Lead a person through the steps, print what they show, and write it.

    Args:
        file: The config that the daemon runs.
        fingers: Names of the fingers; empty: all.
        first: Step to begin with.
        patience_s: How long to wait for each touch, s.
        publish: Where the daemon publishes; None: as the config states.
        requests: Where it accepts requests, likewise.
        key: File with the secret key of this client; None: without keys.
        server_key: File with the public key of the daemon; None: that beside its secret key.
        dry_run: Only print what would change, and move nothing.
        page: Speak with the page ``/commission`` of the live view, not with a person; then nothing moves.

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
    link = link_to(rig, publish, requests, key, server_key)
    restart = f"Now restart the daemon: Ctrl-C in its terminal and slipd run {file} again, or systemctl reload slipd."
    guide = Commission(rig, fingers or list(rig.finger), patience_s, restart, moves=not (dry_run or page))
    try:
        with (PageHost if page else TerminalHost)(file, rig.text, link, write=not dry_run) as host:
            if not isinstance(host, PageHost):
                host.say("s and Enter leaves the present step or finger out; Ctrl-C ends the guide.")
            elif not host.wait_for_begin():
                return False
            complete = follow(guide.run(first), host.respond)
            host.say("\nDone." if complete else "\nNot all of it followed; see above.")
    except SlipdClientError as error:
        raise SlipdError(str(error)) from error
    return complete
