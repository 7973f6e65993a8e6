"""The robot program against a scripted daemon on real sockets."""

import threading
import time

import pytest
import zmq

from slipd.tools.sim.robot_program import Plan, RobotProgram
from slipd_client import lease_keeper
from slipd_client.messages import LEVELS, decode, encode

BOOT = "run1"
QUICK = Plan(
    patience_s=60.0, tare_s=0.01, close_s=0.1, open_s=0.6, end_s=60.0, limit_n=20.0, step_n=50.0, step_s=0.0,
    lease_ms=60_000,
)  # fmt: skip
WELL = {"left.wrench": {"health": 0, "message": ""}, "gripper": {"health": 0, "message": ""}}
ILL = {"left.wrench": {"health": 3, "message": "open, but no reading yet"}, "gripper": {"health": 0, "message": ""}}


class Daemon(threading.Thread):
    """Answer every request with success unless a test scripts otherwise, and publish messages of the test."""

    def __init__(self):
        super().__init__()
        self.context = zmq.Context()
        self.router, self.pub = self.context.socket(zmq.ROUTER), self.context.socket(zmq.XPUB)
        for socket in (self.router, self.pub):
            socket.linger = 0
        self.ports = [socket.bind_to_random_port("tcp://127.0.0.1") for socket in (self.router, self.pub)]
        self.heard, self.answers, self.on = [], {}, {}
        self.seq, self.ending = {}, threading.Event()

    @property
    def endpoints(self):
        return [f"tcp://127.0.0.1:{port}" for port in reversed(self.ports)]

    def ops(self):
        return [body["op"] for body in self.heard if body["op"] not in ("hello", "lease.renew", "status", "tare.get")]

    def requests(self, op):
        return [body for body in self.heard if body["op"] == op]

    def run(self):
        while not self.ending.is_set():
            if self.router.poll(20):
                client, data = self.router.recv_multipart()
                body = decode(data)
                self.heard.append(body)
                self.router.send_multipart([client, encode({"v": 1, "id": body["id"]} | self.answer(body))])
                for topic, message in self.on.pop(body["op"], []):
                    self.publish(topic, message)
        self.router.close()
        self.pub.close()
        self.context.term()

    def answer(self, body):
        scripted = self.answers.get(body["op"])
        if isinstance(scripted, list):
            scripted = scripted.pop(0) if scripted else None
        if isinstance(scripted, str):
            return {"ok": False, "error": {"code": scripted, "message": "scripted", "field": ""}}
        usual = {
            "hello": {"boot": BOOT, "t_ns": time.monotonic_ns(), "fingers": ["left", "right"]},
            "status": {"streams": WELL},
            "tare": {"verified": True, "tare_id": 0},
            "tare.get": {"busy": False, "readings": 400, "tare_id": 1},
            "gripper.close": {"applied_n": body.get("force_n")},
            "grip.set": {"applied_n": body.get("force_n")},
        }
        return {"ok": True, "result": scripted or usual.get(body["op"], {})}

    def publish(self, topic, body):
        self.seq[topic] = self.seq.get(topic, 0) + 1
        head = {"v": 1, "seq": self.seq[topic], "boot": BOOT, "t_ns": time.monotonic_ns()}
        self.pub.send_multipart([topic.encode(), encode(head | body)])


@pytest.fixture(autouse=True)
def renewed_often(monkeypatch):
    """No stall of the machine ends a lease, which is renewed all the same."""
    monkeypatch.setattr(lease_keeper, "RENEWALS", 1000)


@pytest.fixture
def daemon():
    made = Daemon()
    made.start()
    yield made
    made.ending.set()
    made.join()


def slip(finger, grip_needed_n=None, normal_n=7.0):
    verdict = {"finger": finger, "level": "stable", "level_code": 1, "reasons": []}
    return f"slip.{finger}", verdict | {"grip_needed_n": grip_needed_n, "normal_n": normal_n}


def warning(level="warning", reasons=("rotation",), rising=True, finger="left"):
    body = {"finger": finger, "level": level, "level_code": LEVELS.index(level), "previous": "stable", "rising": rising}
    return "warning", body | {"reasons": list(reasons), "utilisation": 0.86}


def work(daemon, plan=QUICK, done=lambda report: report.opened_ns is not None):
    """Run the program until ``done`` of its report, by default until it has opened the gripper, or until it ends."""
    program = RobotProgram(*daemon.endpoints, plan)
    program.start()
    until_s = time.monotonic() + 30.0
    while program.is_alive() and not done(program.report) and time.monotonic() < until_s:
        program.join(0.005)
    program.end()
    program.join(30.0)
    assert not program.is_alive()
    return program.report


def test_it_tares_grips_and_opens_in_this_order(daemon):
    report = work(daemon)
    assert daemon.ops() == [
        "tare", "tare", "lease.acquire", "gripper.activate", "gripper.close", "gripper.open", "lease.release",
    ]  # fmt: skip
    assert [body["finger"] for body in daemon.requests("tare")] == ["left", "right"]
    (close,) = daemon.requests("gripper.close")
    assert (close["force_n"], close["speed_mps"]) == (QUICK.force_n, QUICK.speed_mps)
    assert daemon.requests("gripper.open")[0]["drop"] is True
    assert len(daemon.requests("lease.renew")) >= 3
    assert report.error == ""
    assert report.refusals == []
    assert report.activated_ns < report.closed_ns < report.opened_ns
    assert report.tares["left"]["readings"] == 400


def test_it_waits_until_every_stream_is_well(daemon):
    daemon.answers["status"] = [{"streams": ILL}, {"streams": ILL}]
    assert work(daemon).error == ""
    first_ops = [body["op"] for body in daemon.heard if body["op"] != "hello"][:4]
    assert first_ops == ["status", "status", "status", "tare"]


def test_a_look_that_came_too_late_is_taken_again_and_so_is_a_lease(daemon):
    daemon.answers["status"] = ["deadline_passed"]
    daemon.answers["lease.acquire"] = ["deadline_passed"]
    report = work(daemon)
    assert report.error == ""
    assert daemon.ops().count("lease.acquire") == 2
    assert [text.split(":")[0] for text in report.refusals] == ["deadline_passed"]


def test_it_gives_up_on_streams_that_stay_ill_and_touches_nothing(daemon):
    daemon.answers["status"] = {"streams": ILL}
    report = work(daemon, Plan(patience_s=0.2))
    assert "left.wrench (open, but no reading yet)" in report.error
    assert daemon.ops() == []


def test_a_rotation_warning_makes_it_ask_for_the_grip_that_is_needed(daemon):
    daemon.on["gripper.close"] = [slip("left", 9.5), slip("right", 9.1, 6.9), warning()]
    daemon.on["grip.set"] = [warning("slipping", ["slip_detected", "translation"])]
    report = work(daemon)
    assert [body["force_n"] for body in daemon.requests("grip.set")] == [9.5]
    (made,) = report.raises
    assert (made.requested_n, made.before_n, made.result, made.refusal) == (9.5, 6.9, {"applied_n": 9.5}, "")
    assert report.rotation_warning.level == "warning"
    assert report.rotation_warning.t_ns < report.rotation_warning.received_ns <= made.requested_ns
    assert report.slip_report.level == "slipping"


def test_it_never_asks_for_more_than_its_own_limit(daemon):
    daemon.on["gripper.close"] = [slip("left", 50.0), warning()]
    work(daemon)
    assert [body["force_n"] for body in daemon.requests("grip.set")] == [20.0]


@pytest.mark.parametrize(
    "told",
    [
        [slip("left", 9.5), warning("caution")],
        [slip("left", 9.5), warning(reasons=["translation"])],
        [slip("left", 9.5), warning(rising=False)],
        [slip("left", 5.0), warning()],
        [slip("left"), warning()],
    ],
    ids=["caution", "translation", "falling", "less than it has", "nothing known"],
)
def test_it_leaves_the_grip_alone_when(daemon, told):
    daemon.on["gripper.close"] = told
    report = work(daemon)
    assert daemon.requests("grip.set") == []
    assert len(report.changes) == 1


def test_a_refused_grip_ends_it_and_the_lease_is_given_back(daemon):
    daemon.answers["gripper.close"] = "gripper_fault"
    report = work(daemon)
    assert "gripper_fault" in report.error
    assert daemon.ops()[-1] == "lease.release"


def test_a_missing_daemon_is_reported():
    program = RobotProgram("ipc:///nowhere/publish", "ipc:///nowhere/requests")
    program.run()
    assert "nobody accepts requests" in program.report.error
