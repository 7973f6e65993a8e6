"""Waits until the person has restarted the daemon with the new config."""

from __future__ import annotations

from slipd.errors import SlipdError
from slipd.tools.commission.dialogue import SKIP, Choice, Prompt, Steps
from slipd.tools.commission.readings import SILENCE_S
from slipd_client.friction_session import ElapsedTime
from slipd_client.messages.schema.topics import Message


def wait_for_restart(config_id: str, how: str, longest_s: float) -> Steps[None]:
    """Ask for a restart of the daemon, and wait until it runs a config.

    Args:
        config_id: Of the config that it must run.
        how: What the person does so that the daemon reads it, for people.
        longest_s: How long to wait, s.

    Raises:
        SlipdError: The daemon does not run it in time, or the person does not want to wait.
    """
    yield Prompt("restart", f"{how} This goes on by itself when the daemon runs the new config.")
    elapsed, silent_s = ElapsedTime(), 0.0
    while elapsed.passed_s + silent_s < longest_s:
        event = yield None
        if event is None:
            silent_s += SILENCE_S
        elif isinstance(event, Choice) and event.word == SKIP:
            break
        elif isinstance(event, Message):
            if event.config_id == config_id:
                return
            elapsed.update(event.t_ns * 1e-9)
    raise SlipdError("the daemon does not run the new config; start it, and go on with --from and the next step")
