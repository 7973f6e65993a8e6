"""Give fingers a known zero without a tare, for tests of something else."""

from __future__ import annotations

import time
from dataclasses import replace

from slipd.config import Config, Levels, axes_of
from slipd.config import Finger as FingerConfig
from slipd.finger.finger import Finger
from slipd.gripper.stored_state import StoredState, StoredTare, basis_of, rig_of, seal
from slipd.recording.run_files import state_dir
from slipd.recording.state_file import StateFile


def known_finger(name: str, settings: FingerConfig, levels: Levels) -> Finger:
    """Return a finger whose zeros are known."""
    finger = Finger(name, settings, levels)
    know_zeros(finger)
    return finger


def know_zeros(*fingers: Finger) -> None:
    """Let the zeros of these fingers count as right: a tare would take readings, time and a number."""
    for finger in fingers:
        for channel in (finger.force, finger.image):
            if channel is not None and not channel.zero.known:
                channel.tare.put(replace(channel.tare.current, origin="observed"))


def keep_zeros(settings: Config) -> None:
    """Write what an earlier run would have kept for a daemon with this config: zeros that are right."""
    tares = {}
    for name, stream in settings.streams().items():
        kind = name.partition(".")[2]
        if kind:
            size = 6 if kind == "wrench" else stream.rows * stream.cols * axes_of(stream)  # type: ignore[attr-defined,arg-type]
            tares[name] = StoredTare(
                device="",
                opened=stream.port,
                basis=basis_of(stream),
                id=0,
                wall_ns=time.time_ns(),
                readings=0,
                by="config",
                offset=[0.0] * size,
                std=[0.0] * size,
                gravity_mps2=[0.0] * 3,
                origin="observed",
            )
    rig = rig_of(settings)
    state = StoredState(rig=rig, boot="earlier", kept_wall_ns=time.time_ns() - 60 * 10**9, tares=tares)
    StateFile(state_dir() / f"state-{rig}.json").read()  # makes the folder
    (state_dir() / f"state-{rig}.json").write_text(seal(state.model_dump_json()), encoding="utf-8")
