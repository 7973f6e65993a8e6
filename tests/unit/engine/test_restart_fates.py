"""After a restart, whatever became of the kept state, no finger is believed unless its zero is known."""

from __future__ import annotations

import json
import random
from typing import Any

import numpy as np
import pytest
from engine_rig import BOOT, LEFT, RIGHT, Run

from slipd.events import LinkUp, StateRestored
from slipd.grasp.stored_state import seal

SECOND = 1_000_000_000
EARLIER = BOOT.replace("b", "a")


def kept(run: Run) -> dict[str, Any]:
    """What a run keeps for the next one, as by another boot."""
    return json.loads(run.engine.kept.text(run.t_ns).partition(" ")[2]) | {"boot": EARLIER}


FATES = ("whole", "none", "old", "later", "truncated", "flipped", "another device", "another config", "another rig")
"""What becomes of the state that a run kept."""
KINDS = {
    "scalar": LEFT,
    "charge": LEFT + "charge_tau_s = 2.0\n",
    "alone": LEFT.partition("[finger.left.pad]")[0],
    "config": LEFT + "tare = [" + ", ".join(["30"] * 16) + "]\n",
}


def levels(run: Run, finger: str) -> set[str]:
    return {body["level"] for body in run.published(f"slip.{finger}")}


def hold(run: Run, normal_n: float, bias_n: float, count: int) -> None:
    """Feed both fingers, whose sensors have offsets; a reading that repeats would be suspect."""
    for k in range(count):
        press = round(normal_n * 20) + k % 2
        if "left.pad" in run.engine.links:
            run.image(np.full((4, 4), 30 + (press if normal_n else 0)))
        run.skin(normal_n, ms=5.0)
        run.wrench(normal_n + bias_n, (0.1 * bias_n, 0.0), ms=5.0)


def damaged(fate: str, run: Run, rng: random.Random) -> tuple[str, str | None]:
    """Return the config and the text with which the next run begins, 60 s to an hour later."""
    text, state = run.engine.kept.text(run.t_ns), kept(run) | {"boot": EARLIER}
    config_text = run.engine.kept._config.text
    minutes = {"old": -61, "later": 70}.get(fate, 0)
    state["kept_wall_ns"] += minutes * 60 * SECOND
    text = seal(json.dumps(state))
    if fate == "truncated":
        text = text[: rng.randrange(len(text))]
    elif fate == "flipped":
        at = rng.randrange(len(text))
        text = text[:at] + chr(ord(text[at]) ^ 1 << rng.randrange(5)) + text[at + 1 :]
    elif fate == "another config":
        config_text = config_text.replace("rate_hz = 1000.0", "rate_hz = 900.0").replace(
            "pitch_m = 0.004", "pitch_m = 0.005"
        )
    elif fate == "another rig":
        config_text = config_text.replace("/dev/left-wrench", "/dev/left-sensor")
    return config_text, None if fate == "none" else text


def check_restart(seed: int, fate: str) -> None:
    rng = random.Random(seed)
    kind = rng.choice(list(KINDS))
    normal_n, bias_n = rng.choice((0.0, rng.uniform(1.0, 20.0))), rng.uniform(-9.0, 30.0)
    before = Run(KINDS[kind] + RIGHT.partition("tare =")[0], zeros=False)
    before.up()
    hold(before, 0.0, bias_n, 5)
    assert levels(before, "left") | levels(before, "right") == {"unknown"}, "nobody tared yet"
    for finger in ("left", "right"):
        assert before.refusal("tare", finger=finger, stream="all", seconds=0.1, unloaded=True) is None
    hold(before, 0.0, bias_n, 40)
    assert before.level("left") == before.level("right") == ("no_contact", [])
    hold(before, normal_n, bias_n, 20)
    text, state = damaged(fate, before, rng)
    run = Run(text, zeros=False)
    run.t_ns = before.t_ns + rng.randrange(60, 3400) * SECOND
    if state is not None:
        run.feed(StateRestored(state))
    for name in run.engine.links:
        run.feed(LinkUp(name, f"{'another' if fate == 'another device' else 'opened'} {name}"))
    hold(run, normal_n, bias_n, 20)
    expected = {"stable"} if normal_n else {"no_contact"}
    for finger in ("left", "right"):
        if fate != "whole":
            assert levels(run, finger) == {"unknown"}, f"seed {seed}: {fate}, {kind}, {finger}, {normal_n:.1f} N"
        elif finger == "left" and kind in ("charge", "alone"):
            assert "stable" not in levels(run, finger), "without an image, or without the beginning of its contact"
        else:
            assert levels(run, finger) <= expected | {"unknown"}
            assert run.level(finger)[0] in expected, f"seed {seed}: {kind}, {finger}, {normal_n:.1f} N"


@pytest.mark.parametrize(
    ("fate", "seeds"),
    [
        *((fate, range(k, k + 1)) for k, fate in enumerate(("whole", *FATES))),
        *(pytest.param(fate, range(100, 103), marks=pytest.mark.statistics) for fate in FATES),
        *(pytest.param(fate, range(110), marks=[pytest.mark.long, pytest.mark.timeout(900)]) for fate in FATES),
    ],
)
def test_F6_no_finger_is_believed_after_a_restart_unless_its_zero_is_known(fate: str, seeds: range) -> None:
    for seed in seeds:
        check_restart(seed, fate)
