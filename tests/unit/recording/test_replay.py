from collections.abc import Iterator
from pathlib import Path

import pytest
from project import TRIAL

from slipd import config
from slipd.engine.engine import Engine
from slipd.errors import ConfigError, RecordingError
from slipd.events import Bytes, Event, LinkDown, LinkUp, Publish, Reply, Request, Tick
from slipd.recording.entry_walk import Entered
from slipd.recording.reader import Recording, open_recording
from slipd.recording.replay import Pace, replay
from slipd.recording.writer import Recorder
from slipd.tools.recordings.grips_import import import_trial
from slipd_client import messages

WALL_NS = 1_645_500_000_123_456_789
BOOT = "a1b2c3"


def request(t_ns: int, op: str, **fields: object) -> Request:
    envelope = {"v": messages.PROTOCOL_VERSION, "id": 7, "boot": BOOT, "deadline_ns": t_ns + 100_000_000}
    return Request(b"\x00tester", {"op": op, **envelope, **fields})


def eventful(trial: Recording) -> Iterator[tuple[int, Event]]:
    """The trial with disturbances: split bytes, valid and invalid requests, a lost link, a suspended host."""
    for index, (t_ns, event) in enumerate(trial.events()):
        if isinstance(event, Bytes):
            cut = index % len(event.data)
            yield t_ns, Bytes(event.link, event.data[:cut])
            yield t_ns, Bytes(event.link, event.data[cut:])
        else:
            yield t_ns, event
        if index == 100:
            yield t_ns, request(t_ns, "tare", finger="left", stream="pad", seconds=0.2, unloaded=True)
        if index == 150:
            yield t_ns, request(t_ns, "lease.acquire", ttl_ms=100, id=8)
            yield t_ns, request(t_ns, "friction.set", finger="right", mu_s=0.9, id=9)
        if index == 200:
            yield t_ns, request(t_ns, "tare.undo", finger="left")
            yield t_ns, request(t_ns, "grip.set", force_n=2.0)
            yield t_ns, request(t_ns, "no.such.op")
        if index == 300:
            yield t_ns, LinkDown("left.pad", "unplugged")
            yield t_ns, LinkUp("left.pad", "ws://127.0.0.1:5000")
            yield t_ns, Bytes("left.pad", b'{"message":1,"1":\xff noise}')
        if index == 400:
            yield t_ns, Tick(suspended_ns=3_000_000_000)


@pytest.fixture
def trial(tmp_path: Path, two_pads: str) -> Recording:
    import_trial(TRIAL, tmp_path / "trial.mcap", two_pads)
    return open_recording(tmp_path / "trial.mcap")


@pytest.fixture
def live(trial: Recording, tmp_path: Path, two_pads: str) -> Recording:
    """A live run of the disturbed trial, recorded as by the service."""
    settings = config.parse(two_pads, "two_pads.toml")
    engine = Engine(settings, boot=BOOT, wall_minus_monotonic_ns=WALL_NS)
    path = tmp_path / "live.mcap"
    recorder = Recorder(path, config_text=two_pads, boot=BOOT, wall_minus_monotonic_ns=WALL_NS)
    refused = 0
    for t_ns, event in eventful(trial):
        recorder.event(event, t_ns)
        for output in engine.handle(event, t_ns):
            if isinstance(output, Publish):
                recorder.published(output.topic, messages.encode(output.body), t_ns)
            refused += isinstance(output, Reply) and not output.body["ok"]
    recorder.close()
    assert recorder.lost == 0
    assert refused == 2, "the requests that were meant well were taken"
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


def test_messages_stand_right_behind_the_event_that_caused_them(live: Recording) -> None:
    settings = config.parse(live.config_text, "again")
    engine = Engine(settings, boot=live.boot, wall_minus_monotonic_ns=live.wall_minus_monotonic_ns)
    due: list[bytes] = []
    for entry in live.entries():
        if isinstance(entry, Entered):
            assert due == []
            outputs = engine.handle(entry.event, entry.t_ns)
            due = [messages.encode(output.body) for output in outputs if isinstance(output, Publish)]
        else:
            assert entry.payload == due.pop(0)
    assert due == []


def test_the_recorded_speed_is_kept_or_multiplied(trial: Recording) -> None:
    for speed in (1.0, 4.0):
        waits_s: list[float] = []
        paced = list(replay(trial, speed=speed, sleep=waits_s.append))
        # No time passes in the sleeps of this test, so none is longer than the whole way from the start.
        assert 0.0 < max(waits_s) <= 5.25 / speed
        assert paced == list(replay(trial))


class Clock:
    def __init__(self) -> None:
        self.now_ns = 77_000_000_000
        self.waits_s: list[float] = []

    def sleep(self, seconds: float) -> None:
        self.waits_s.append(seconds)
        self.now_ns += round(seconds * 1e9)

    def now(self) -> int:
        return self.now_ns


@pytest.mark.parametrize(("speed", "waits_s"), [(1.0, [0.5, 0.5]), (2.0, [0.25, 0.25]), (0.5, [1.0, 1.0])])
def test_pace_lets_recorded_time_pass_at_its_speed(speed: float, waits_s: list[float]) -> None:
    clock = Clock()
    pace = Pace(speed, clock.sleep, clock.now)
    for t_ns in (5_000_000_000, 5_500_000_000, 5_500_000_000, 6_000_000_000):
        pace.wait_until(t_ns)
    assert clock.waits_s == pytest.approx(waits_s)


def test_pace_makes_up_for_time_spent_elsewhere() -> None:
    clock = Clock()
    pace = Pace(1.0, clock.sleep, clock.now)
    pace.wait_until(0)
    clock.now_ns += 700_000_000
    pace.wait_until(500_000_000)
    pace.wait_until(1_000_000_000)
    assert clock.waits_s == pytest.approx([0.3])


@pytest.mark.parametrize("speed", [0.0, -1.0, float("inf"), float("nan")])
def test_a_speed_that_is_none_is_a_bad_call(trial: Recording, speed: float) -> None:
    with pytest.raises(ValueError, match="speed"):
        replay(trial, speed=speed)


def test_a_recorded_config_with_faults_is_reported(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path / "run.mcap", config_text="muh = 1", boot="b", wall_minus_monotonic_ns=0)
    recorder.close()
    with pytest.raises(ConfigError, match=r"run\.mcap: config:1: muh"):
        replay(open_recording(tmp_path / "run.mcap"))


def test_an_event_of_an_unknown_link_is_reported(tmp_path: Path, two_pads: str) -> None:
    recorder = Recorder(tmp_path / "run.mcap", config_text=two_pads, boot="b", wall_minus_monotonic_ns=0)
    recorder.event(LinkUp("middle.pad", ""), 1)
    recorder.close()
    with pytest.raises(RecordingError, match=r"must have the link 'middle\.pad' of an event, got left\.pad"):
        list(replay(open_recording(tmp_path / "run.mcap")))
