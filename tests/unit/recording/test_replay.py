from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from project import TRIAL
from recorded_entries import TWO_PADS

from slipd import config
from slipd.engine.engine import Engine
from slipd.errors import ConfigError, RecordingError
from slipd.events import Bytes, Event, LinkDown, LinkUp, Publish, Reply, Request, Tick
from slipd.recording.mcap_file import EVENTS, RunHead
from slipd.recording.reader import Recording, open_recording
from slipd.recording.recorder import Recorder
from slipd.recording.replay import PlaybackPace, replay
from slipd.tools.recordings.grips_import import import_trial
from slipd_client import messages

WALL_NS = 1_645_500_000_123_456_789
BOOT = "a1b2c3"


def request(t_ns: int, op: str, **fields: object) -> Request:
    envelope = {"v": messages.PROTOCOL_VERSION, "id": 7, "boot": BOOT, "deadline_ns": t_ns + 100_000_000}
    return Request(b"\x00tester", {"op": op, **envelope, **fields})


DISTURBED: dict[int, list[Event | dict[str, Any]]] = {
    100: [{"op": "tare", "finger": "left", "stream": "pad", "seconds": 0.2, "unloaded": True}],
    150: [
        {"op": "lease.acquire", "ttl_ms": 100, "id": 8},
        {"op": "friction.set", "finger": "right", "mu_s": 0.9, "id": 9},
    ],
    200: [{"op": "tare.undo", "finger": "left"}, {"op": "grip.set", "force_n": 2.0}, {"op": "no.such.op"}],
    300: [
        LinkDown("left.pad", "unplugged"),
        LinkUp("left.pad", "ws://127.0.0.1:5000"),
        Bytes("left.pad", b'{"message":1,"1":\xff noise}'),
    ],
    400: [Tick(suspended_ns=3_000_000_000)],
}
"""Index of an event of the trial, and what follows it; maps are requests."""


def eventful(trial: Recording) -> Iterator[tuple[int, Event]]:
    """The trial with disturbances: split bytes, valid and invalid requests, a lost link, a suspended host."""
    for index, (t_ns, event) in enumerate(trial.events()):
        if isinstance(event, Bytes):
            cut = index % len(event.data)
            yield t_ns, Bytes(event.link, event.data[:cut])
            yield t_ns, Bytes(event.link, event.data[cut:])
        else:
            yield t_ns, event
        for disturbance in DISTURBED.get(index, []):
            yield t_ns, request(t_ns, **disturbance) if isinstance(disturbance, dict) else disturbance


@pytest.fixture
def trial(tmp_path: Path) -> Recording:
    import_trial(TRIAL, tmp_path / "trial.mcap", TWO_PADS)
    return open_recording(tmp_path / "trial.mcap")


@pytest.fixture
def live(trial: Recording, tmp_path: Path) -> Recording:
    """A live run of the disturbed trial, recorded as by the service."""
    engine = Engine(config.parse(TWO_PADS, "two_pads.toml"), boot=BOOT, wall_minus_monotonic_ns=WALL_NS)
    path = tmp_path / "live.mcap"
    recorder = Recorder(path, RunHead(TWO_PADS, BOOT, WALL_NS))
    refused = 0
    for t_ns, event in eventful(trial):
        recorder.add(EVENTS, event, t_ns)
        for output in engine.handle(event, t_ns):
            if isinstance(output, Publish):
                recorder.add(output.topic, messages.encode(output.body), t_ns)
            refused += isinstance(output, Reply) and not output.body["ok"]
    recorder.close()
    assert (recorder.lost, refused) == (0, 2), "the requests that were meant well were taken"
    return open_recording(path)


def test_K5_a_replay_publishes_byte_for_byte_what_the_live_run_published(live: Recording) -> None:
    recorded = list(live.messages())
    replayed = [(topic, messages.encode(body)) for topic, body in replay(live)]
    assert replayed == recorded
    assert live.complete
    assert len(recorded) > 500
    mus = {(body["mu"], body["mu_source"]) for topic, body in replay(live) if topic == "slip.right"}
    assert mus == {(0.5, "config"), (0.9, "request"), (1.0, "learned")}, "stated, raised under the lease, and carried"
    assert {topic for topic, _ in recorded} >= {"slip.left", "slip.right", "tactile.left", "warning", "status"}


def test_the_recorded_speed_is_kept(trial: Recording) -> None:
    """So slow that no computer is late; no time passes in the sleeps, so the last is the whole way from the start."""
    waits_s: list[float] = []
    paced = list(replay(trial, on_event=PlaybackPace(1e-3, waits_s.append).wait_until))
    assert 5000.0 < max(waits_s) <= 5250.0
    assert paced == list(replay(trial))


@pytest.mark.parametrize(
    ("speed", "spent_s", "waits_s"),
    [(1.0, 0.0, [0.5, 0.5]), (2.0, 0.0, [0.25, 0.25]), (0.5, 0.0, [1.0, 1.0]), (1.0, 0.7, [0.3])],
)
def test_pace_lets_recorded_time_pass_at_its_speed_and_makes_up_for_time_spent_elsewhere(
    speed: float, spent_s: float, waits_s: list[float]
) -> None:
    waited_s: list[float] = []
    elsewhere_s = [77.0]
    pace = PlaybackPace(speed, waited_s.append, lambda: round(1e9 * sum(elsewhere_s + waited_s)))
    pace.wait_until(5_000_000_000)
    elsewhere_s.append(spent_s)
    for t_ns in (5_500_000_000, 5_500_000_000, 6_000_000_000):
        pace.wait_until(t_ns)
    assert waited_s == pytest.approx(waits_s)


@pytest.mark.parametrize(
    ("config_text", "error", "fault"),
    [
        ("muh = 1", ConfigError, r"run\.mcap: config:1: muh"),
        (TWO_PADS, RecordingError, r"must have the link 'middle\.pad' of an event, got left\.pad"),
    ],
)
def test_a_recording_whose_config_is_wrong_or_lacks_a_link_is_reported(
    tmp_path: Path, config_text: str, error: type[Exception], fault: str
) -> None:
    recorder = Recorder(tmp_path / "run.mcap", RunHead(config_text, "b", 0))
    recorder.add(EVENTS, LinkUp("middle.pad", ""), 1)
    recorder.close()
    with pytest.raises(error, match=fault):
        list(replay(open_recording(tmp_path / "run.mcap")))
