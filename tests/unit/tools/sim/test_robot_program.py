"""The robot program against a scripted daemon, in simulated time: no stall of the machine changes what it does."""

from __future__ import annotations

from collections import deque
from contextlib import contextmanager
from dataclasses import fields
from types import SimpleNamespace

import pytest

from slipd.tools.sim import robot_program
from slipd.tools.sim.robot_program import Plan, RobotProgram
from slipd_client.errors import RequestRefused
from slipd_client.messages.topics import Slip, SlipWarning

PLAN = Plan(limit_n=20.0, step_n=50.0, step_s=0.0)
WELL = {"left.wrench": {"health": 0, "message": ""}, "gripper": {"health": 0, "message": ""}}
LATE = {name: {"health": 1, "message": "the daemon was late by 0.07 s: readings waited"} for name in WELL}
ILL = {"left.wrench": {"health": 3, "message": "open, but no reading yet"}, "gripper": {"health": 0, "message": ""}}

POSITIONAL = {"tare": ("finger", "seconds"), "gripper_close": ("force_n",), "grip_set": ("force_n",)}


class Daemon:
    """Subscriber and client of the program, and its clock: whatever it waits for takes simulated time alone."""

    def __init__(self):
        self.now_s, self.heard, self.answers, self.on, self.inbox = 0.0, [], {}, {}, deque()

    def ask(self, op, **fields):
        self.heard.append((op, fields))
        self.now_s += 0.001
        scripted = self.answers.get(op)
        if isinstance(scripted, list):
            scripted = scripted.pop(0) if scripted else None
        if isinstance(scripted, str):
            raise RequestRefused(scripted, "scripted")
        self.inbox += self.on.pop(op, [])
        return scripted or {"streams": WELL, "fingers": ["left", "right"], "applied_n": fields.get("force_n")}

    def receive(self, timeout_s):
        if self.inbox:
            return self.inbox.popleft()
        self.now_s += timeout_s
        return None

    def wait(self, seconds):
        self.now_s += seconds

    @contextmanager
    def lease(self, ttl_ms):
        self.ask("lease.acquire")
        yield
        self.ask("lease.release")

    def __getattr__(self, op):
        return lambda *args, **fields: self.ask(
            op.replace("_", "."), **dict(zip(POSITIONAL.get(op, ()), args, strict=True)), **fields
        )

    def forces(self):
        return [fields["force_n"] for op, fields in self.heard if op == "grip.set"]


@pytest.fixture
def daemon(monkeypatch):
    made = Daemon()

    @contextmanager
    def connected(*_):
        yield made

    clock = SimpleNamespace(monotonic=lambda: made.now_s, monotonic_ns=lambda: round(made.now_s * 1e9))
    for name, fake in (("time", clock), ("Subscriber", connected), ("GripClient", connected)):
        monkeypatch.setattr(robot_program, name, fake)
    return made


def work(daemon, plan=PLAN):
    program = RobotProgram("", "", plan)
    program._ending = SimpleNamespace(wait=daemon.wait, is_set=lambda: False)
    program.run()
    return program.report


def message(kind, **known):
    """Return a message whose other fields say nothing."""
    return kind(**{each.name: None for each in fields(kind)} | known)


def slip(finger, grip_needed_n=None, normal_n=7.0, t_ns=0):
    return message(Slip, finger=finger, grip_needed_n=grip_needed_n, normal_n=normal_n, t_ns=t_ns)


def warning(level="warning", reasons=("rotation",), rising=True):
    return message(SlipWarning, t_ns=1, level=level, reasons=reasons, rising=rising)


@pytest.mark.parametrize("streams", [WELL, LATE], ids=["well", "on a busy machine"])
def test_it_tares_grips_and_opens_in_this_order(daemon, streams):
    daemon.answers["status"] = {"streams": streams}
    report = work(daemon)
    assert [(op, fields) for op, fields in daemon.heard if op not in ("hello", "status")] == [
        ("tare", {"finger": "left", "seconds": PLAN.tare_s}),
        ("tare", {"finger": "right", "seconds": PLAN.tare_s}),
        ("lease.acquire", {}),
        ("gripper.activate", {}),
        ("gripper.close", {"force_n": PLAN.force_n, "speed_mps": PLAN.speed_mps}),
        ("gripper.open", {"drop": True}),
        ("lease.release", {}),
    ]
    assert (report.error, report.refusals, set(report.tares)) == ("", [], {"left", "right"})
    taken_s = [(t_ns - report.activated_ns) / 1e9 for t_ns in (report.closed_ns, report.opened_ns)]
    assert taken_s == pytest.approx([PLAN.close_s, PLAN.open_s], abs=0.1)


@pytest.mark.parametrize(
    ("op", "codes", "asked"),
    [
        ("lease.acquire", ["deadline_passed"], 2),
        ("tare", ["deadline_passed", *["not_ready"] * 4], 7),
        ("gripper.activate", ["in_contact"], 2),
        ("gripper.close", ["no_lease"], 2),
        ("grip.set", ["too_fast"], 2),
        ("grip.set", ["deadline_passed"], 2),
        ("gripper.open", ["not_ready"], 2),
    ],
)
def test_what_a_stall_of_the_machine_refused_is_asked_for_again(daemon, op, codes, asked):
    daemon.answers |= {op: list(codes), "status": [{"streams": ILL}, "deadline_passed", {"streams": WELL}]}
    daemon.on["gripper.close"] = [slip("left", 9.5), warning()]
    report = work(daemon)
    assert (report.error, [name for name, _ in daemon.heard].count(op), daemon.forces()[-1]) == ("", asked, 9.5)
    assert report.opened_ns is not None


@pytest.mark.parametrize(("answers", "error", "last"), [
    ({"status": {"streams": ILL}}, "left.wrench (open, but no reading yet)", []),
    ({"status": "internal"}, "internal", []),
    ({"tare": "in_contact"}, "in_contact", ["tare"]),
    ({"gripper.close": "gripper_fault"}, "gripper_fault", ["gripper.close"]),
])  # fmt: skip
def test_what_does_not_pass_by_itself_ends_it_with_the_reason(daemon, answers, error, last):
    daemon.answers |= answers
    assert error in work(daemon).error
    assert [op for op, _ in daemon.heard if op not in ("hello", "status")][-1:] == last


def test_a_rotation_warning_makes_it_ask_for_the_grip_that_is_needed(daemon):
    later = slip("left", 9.5, 9.4, t_ns=10**10)
    daemon.on["gripper.close"] = [slip("left", 9.5), slip("right", 9.1, 6.9), warning()]
    daemon.on["grip.set"] = [warning("slipping", ["slip_detected", "translation"]), later, slip("right", 9.1, 9.3)]
    report = work(daemon)
    (made,) = report.raises
    assert (made.requested_n, made.before_n, made.after_n, made.refusal) == (9.5, 6.9, 6.9, "")
    assert (report.rotation_warning.level, report.slip_report.level) == ("warning", "slipping")


@pytest.mark.parametrize(
    ("told", "plan", "asked"),
    [
        ([slip("left", 50.0), warning()], PLAN, [20.0]),
        ([slip("left", 9.5), warning()], Plan(), [9.0, 9.5]),
        ([slip("left"), warning(reasons=["rotation", "unsupportable"])], PLAN, [20.0]),
        ([slip("left"), warning(), slip("left", 9.5)], PLAN, [9.5]),
        ([slip("left", 9.5), warning("caution")], PLAN, []),
        ([slip("left", 9.5), warning(reasons=["translation"])], PLAN, []),
        ([slip("left", 9.5), warning(rising=False)], PLAN, []),
        ([slip("left", 5.0), warning()], PLAN, []),
        ([slip("left"), warning()], PLAN, []),
    ],
    ids=[
        *("own limit", "steps", "unsupportable", "a later verdict knows"),
        *("caution", "translation", "falling", "less than it has", "nothing known"),
    ],
)
def test_it_asks_for_what_is_needed_within_its_limits_and_otherwise_for_nothing(daemon, told, plan, asked):
    daemon.on["gripper.close"] = told
    report = work(daemon, plan)
    assert (daemon.forces(), len(report.changes)) == (asked, 1)


def test_a_raise_that_is_refused_is_noted_and_the_work_goes_on(daemon):
    daemon.answers["grip.set"] = "force_limit"
    daemon.on["gripper.close"] = [slip("left", 9.5), warning()]
    report = work(daemon)
    assert [each.refusal.partition(":")[0] for each in report.raises] == ["force_limit"]
    assert report.opened_ns is not None


def test_a_missing_daemon_is_reported():
    program = RobotProgram("ipc:///nowhere/publish", "ipc:///nowhere/requests")
    program.run()
    assert "nobody accepts requests" in program.report.error
