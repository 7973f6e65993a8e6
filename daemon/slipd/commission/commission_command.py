"""``slipd commission``: find how the sensors are mounted by touching the pads, and write it into the config."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path

from slipd import config
from slipd.commission.commission_guide import CommissionGuide
from slipd.commission.config_update import FingerResult, changed_text, changes, fragment, replace_config
from slipd.commission.readings import SILENCE_S, ReadingListener
from slipd.errors import SlipdError
from slipd_client.errors import RequestRefused, SlipdClientError
from slipd_client.grip import GripClient
from slipd_client.subscriber import Subscriber

TARE_S = 0.5

NEXT = """\
Next, with the daemon running the new config (docs/first_day.md):
  slipctl tare take {finger}            nothing touches the fingers
  slipctl gravity, slipd identify    weigh the finger in a few poses
  slipctl friction {finger}             measure the friction
  slipctl grip close 10              first grasp"""


def commission_command(
    file: Path, fingers: list[str], publish: str | None, requests: str | None, patience_s: float, *, write: bool
) -> bool:
    """Lead a person through the touches of each finger, print what they show, and write it.

    Args:
        file: The config that the daemon runs.
        fingers: Names of the fingers; empty: all.
        publish: Where the daemon publishes; None: as the config states.
        requests: Where it accepts requests, likewise.
        patience_s: How long to wait for each touch, s.
        write: Write the config; else only print what would change.

    Returns:
        Whether everything followed from the touches.

    Raises:
        ConfigError: The config has faults.
        SlipdError: A finger is unknown, the daemon is silent or runs another config, or nothing was touched.
    """
    rig = config.load(file)
    for name in fingers:
        if name not in rig.finger:
            raise SlipdError(f"--finger must be one of {', '.join(rig.finger)}, got {name!r:.40}")
    results: dict[str, FingerResult] = {}
    complete = True
    with _connected(publish or rig.bus.publish, requests or rig.bus.requests) as (subscriber, client):
        listener = ReadingListener(lambda: subscriber.receive(SILENCE_S), rig.finger, rig.config_id)
        guide = CommissionGuide(rig, listener, _say, patience_s)
        for name in fingers or rig.finger:
            _say("Touch nothing: the zero is taken.")
            _tare(client, name)
            subscriber.newest()  # the readings before the zero was taken
            outcome = guide.run(name)
            for note in outcome.findings.notes:
                _say(f"  {name}: {note}")
            for problem in outcome.findings.problems:
                _say(f"  {name}: not found: {problem}")
            complete = complete and not outcome.findings.problems
            results[name] = outcome.result
    found = changes(rig, results)
    if not found:
        _say("\nThe config needs no change." if complete else "\nNothing is changed.")
    else:
        _write(file, rig, found, write=write)
    if complete:
        _say(NEXT.format(finger=next(iter(results))))
    return complete


def _write(file: Path, rig: config.Config, found: dict[tuple[str, ...], str], *, write: bool) -> None:
    _say(f"\n{fragment(found)}\n")
    try:
        text = changed_text(rig.text, found)
        if not write:
            _say(f"{file}: not changed, as asked")
        elif file.read_text(encoding="utf-8") != rig.text:
            raise SlipdError(f"{file}: it was changed meanwhile and is left as it is; put the lines above into it")
        else:
            previous = replace_config(file, text)
            _say(f"{file}: changed; the config before is {previous}. Restart the daemon to use it.")
    except (OSError, ValueError) as error:
        raise SlipdError(f"{file} is left as it was: {error}; put the lines above into it") from error


def _tare(client: GripClient, finger: str) -> None:
    """Take the zero of a finger, because a charge pad shows no image before its finger was seen free."""
    try:
        with client.lease():
            client.tare(finger, TARE_S, unloaded=True)
    except RequestRefused as error:
        _say(f"  not taken: {error}")


@contextlib.contextmanager
def _connected(publish: str | None, requests: str | None) -> Iterator[tuple[Subscriber, GripClient]]:
    """Connect to the daemon; errors of the client are errors of this command."""
    try:
        with GripClient(requests) as client, Subscriber(publish, ("wrench", "tactile")) as subscriber:
            yield subscriber, client
    except SlipdClientError as error:
        raise SlipdError(str(error)) from error


def _say(text: str) -> None:
    print(text, flush=True)
