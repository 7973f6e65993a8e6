"""A simulated grasp through bytes and engine, against the truth of its trace."""

from dataclasses import replace

import numpy as np
import pytest
from evaluate import offline_grasp
from evaluate.finger_sensing import FingerSensing, ForceSensing, PadSensing, offline_config
from evaluate.offline_grasp import BEGIN_NS, BOOT, Asked, run_offline
from simulated_grasp.contact_patch import ContactPatch
from simulated_grasp.grasp_parts import FrictionLaw, GraspedObject, PadCompliance
from simulated_grasp.load_history import LoadHistory
from simulated_grasp.trace import simulate

from slipd.recording.mcap_file import RecordingFile, RunHead
from slipd.recording.reader import open_recording
from slipd.recording.replay import replay
from slipd.tools.sim.emulated_pvdf import PvdfElectronics
from slipd_client.messages import encode

CENTRE_M = (0.002, -0.001)
BOTH = {"left": FingerSensing(), "right": FingerSensing()}
LEFT = {"left": FingerSensing()}
GRIP_N, WEIGHT_N, SPIN_NM, PULL_N = 8.0, 2.0, 0.03, 12.0
PULLED_S = 1.0


def trace(pull_n=0.0):
    """A grasp whose weight comes on within half a second; from `PULLED_S` on a pull grows by 20 N/s."""
    t = np.arange(0.0, 1.8, 0.001)
    force = np.zeros((t.size, 2))
    force[:, 0] = WEIGHT_N * np.clip(t / 0.5, 0.0, 1.0)
    force[:, 1] = np.clip((t - PULLED_S) * 20.0, 0.0, pull_n)
    torque = SPIN_NM * np.clip(t / 0.5, 0.0, 1.0)
    history = LoadHistory(t, force, torque, np.full(t.size, GRIP_N), about_m=CENTRE_M)
    return simulate(GraspedObject(), ContactPatch(centre_m=CENTRE_M), FrictionLaw(), PadCompliance(), history)


@pytest.fixture(scope="module")
def held():
    return trace()


def slips(heard, finger="left"):
    return [one for one in heard if one.topic == f"slip.{finger}"]


def mean(heard, key, finger="left", from_s=0.7):
    return np.mean([one.body[key] for one in slips(heard, finger) if one.t_ns > from_s * 1e9], axis=0)


def test_the_contact_that_the_engine_reports_is_that_of_the_trace_on_both_fingers(held):
    heard = run_offline(held, BOTH, offline_config(BOTH, 0.55), 1)
    for finger, side in (("left", 1.0), ("right", -1.0)):
        assert mean(heard, "normal_n", finger) == pytest.approx(GRIP_N, abs=0.02)
        assert mean(heard, "tangential_n", finger) == pytest.approx([WEIGHT_N / 2, 0.0], abs=0.02)
        assert mean(heard, "centroid_m", finger) == pytest.approx((CENTRE_M[0], side * CENTRE_M[1]), abs=1e-4)
        assert mean(heard, "spin_nm", finger) == pytest.approx(side * SPIN_NM / 2, abs=5e-4)
        true = held.utilisation[held.t_s > 0.7].mean()
        assert mean(heard, "utilisation", finger) * 0.55 / 0.6 == pytest.approx(true, rel=0.05)
        images = [one.body for one in heard if one.topic == f"tactile.{finger}" and one.t_ns > 7e8]
        assert np.mean([image["centroid_m"] for image in images], axis=0) == pytest.approx(
            (CENTRE_M[0], side * CENTRE_M[1]), abs=5e-4
        )


def test_times_are_those_of_the_trace():
    heard = run_offline(trace(PULL_N), LEFT, offline_config(LEFT, 0.55), 1)
    pulled = next(one for one in slips(heard) if one.t_ns > 0 and abs(one.body["tangential_n"][1]) > 0.5)
    read_s = (pulled.body["t_ns"] - BEGIN_NS) * 1e-9
    assert read_s == pytest.approx(PULLED_S + 2 * 0.5 / 20.0, abs=0.03)
    assert read_s <= pulled.t_ns * 1e-9 < read_s + 0.005


def test_an_object_that_is_pulled_out_is_reported_as_slipping():
    pulled = trace(PULL_N)
    slides_s = pulled.t_s[pulled.gross & (pulled.t_s > PULLED_S)][0]
    heard = run_offline(pulled, LEFT, offline_config(LEFT, 0.55), 1)
    first = next(one for one in heard if one.topic == "warning" and one.body["level"] == "slipping")
    assert slides_s < first.t_ns * 1e-9 < slides_s + 0.15
    warned = next(one for one in heard if one.topic == "warning" and one.body["level"] == "warning")
    assert warned.t_ns * 1e-9 < slides_s


def test_the_same_seed_gives_the_same_messages_and_another_does_not(held):
    first, again, other = (
        [(t, topic, encode(body)) for t, topic, body in run_offline(held, LEFT, offline_config(LEFT, 0.55), seed)]
        for seed in (3, 3, 4)
    )
    assert first == again
    assert first != other


def test_a_long_grasp_is_played_part_by_part(held, monkeypatch):
    text = offline_config(LEFT, 0.55)
    whole = run_offline(held, LEFT, text, 3)
    monkeypatch.setattr(offline_grasp, "PART", 700)
    parts = run_offline(held, LEFT, text, 3)
    assert [(one.t_ns, one.topic) for one in parts] == [(one.t_ns, one.topic) for one in whole]
    assert mean(parts, "utilisation") == pytest.approx(mean(whole, "utilisation"), rel=1e-3)


def test_its_recording_replays_to_the_same_messages(held, tmp_path):
    text = offline_config(LEFT, 0.55)
    path = tmp_path / "offline.mcap"
    file = RecordingFile(path, RunHead(text, BOOT, 0))
    heard = run_offline(held, LEFT, text, 5, log=file)
    file.finish(sum(1 for _ in heard))
    recording = open_recording(path)
    assert [(one.topic, encode(one.body)) for one in heard] == [
        (topic, encode(body)) for topic, body in replay(recording)
    ]
    assert list(recording.messages()) == [(one.topic, encode(one.body)) for one in heard]


def test_a_tare_takes_the_bias_and_leaves_the_drift(held):
    force = ForceSensing(bias=(1.0, -2.0, 0.5, 0.01, 0.02, -0.01), drift_per_s=(0.0, 0.1, *(0.0,) * 4))
    sensors = {"left": FingerSensing(force=force)}
    heard = run_offline(held, sensors, offline_config(sensors, 0.55), 1)
    passed_s = np.mean([one.t_ns * 1e-9 for one in slips(heard) if one.t_ns > 7e8]) + 1.05  # since the tare
    assert mean(heard, "tangential_n") == pytest.approx([WEIGHT_N / 2, 0.1 * passed_s], abs=0.02)


def test_a_misplaced_pad_moves_the_image(held):
    sensors = {"left": FingerSensing(pad=PadSensing(off_m=(0.003, 0.0)))}
    heard = run_offline(held, sensors, offline_config(sensors, 0.55), 1)
    images = [one.body["centroid_m"] for one in heard if one.topic == "tactile.left" and one.t_ns > 7e8]
    assert np.mean(images, axis=0) == pytest.approx((CENTRE_M[0] - 0.003, CENTRE_M[1]), abs=5e-4)


def test_a_finger_may_lack_its_pad(held):
    sensors = {"left": FingerSensing(pad=None)}
    heard = run_offline(held, sensors, offline_config(sensors, 0.55), 1)
    assert "left.pad" not in next(one.body for one in heard if one.topic == "status")["streams"]
    assert mean(heard, "normal_n") == pytest.approx(GRIP_N, abs=0.02)


def test_a_request_is_made_at_its_time(held):
    asked = Asked(0.9, "friction.set", {"finger": "left", "mu_s": 0.5})
    heard = run_offline(held, LEFT, offline_config(LEFT, 0.55), 1, requests=[asked])
    changed = next(one.t_ns for one in slips(heard) if one.body["mu"] == 0.5)
    assert 0.9 <= changed * 1e-9 < 0.95


def test_what_does_not_fit_is_refused(held):
    with pytest.raises(ValueError, match=r"right\.wrench must be in the config as gauges, got nothing"):
        run_offline(held, BOTH, offline_config(LEFT, 0.55), 1)
    asked = Asked(0.5, "friction.set", {"finger": "left", "mu_s": 99.0})
    with pytest.raises(ValueError, match="a request of an offline run must be granted"):
        run_offline(held, LEFT, offline_config(LEFT, 0.55), 1, requests=[asked])


def test_fewer_taxels_and_faulty_ones_are_read(held):
    pad = PadSensing(rows=4, cols=4, pitch_m=0.01, electrode_m=0.005, electronics=PvdfElectronics(dead=(5,)))
    sensors = {"left": replace(FingerSensing(), pad=pad)}
    heard = run_offline(held, sensors, offline_config(sensors, 0.55), 1)
    image = [one.body for one in heard if one.topic == "tactile.left"][-1]
    assert (image["rows"], image["cols"]) == (4, 4)
    pressed = held.taxel_loads(pad, [1.5])[0] > 0.1
    assert [bool(load) for load in image["loads_n"]] == [load and k != 5 for k, load in enumerate(pressed)]
