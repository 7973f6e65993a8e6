"""With a reflex, what a client states may move the gripper: it needs the lease, as a motion does."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from grasp_table import grasp_table
from motions.cell import BUDGET_N, RAISE_N_PER_S, STEP_N, Cell, brought_up
from motions.jaws import GRIPPERS, Jaws

EACH = pytest.mark.parametrize("jaws", GRIPPERS.values(), ids=GRIPPERS.keys())
STATED: tuple[tuple[str, dict[str, Any]], ...] = (
    ("friction.set", {"mu_s": 0.02}),
    ("friction.set", {"mu_s": 0.5, "mu_d": 0.499}),
    ("gravity.set", {"finger": "left", "gravity_mps2": [40.0, 0.0, 0.0]}),
    ("tare", {"seconds": 0.05}),
    ("tare.undo", {}),
    ("object.set", {"name": "mug"}),
)


def held(jaws: type[Jaws]) -> tuple[Cell, list[Any]]:
    """A part held with 6 N, with twice the friction that its load needs, and what is sent from here on."""
    cell = brought_up(jaws, 6.0)
    sent: list[Any] = []
    cell.pull = 0.2
    cell.run(200)
    cell.on_sent = lambda command: sent.append(command) if command.kind != "other" else None
    return cell, sent


def state(cell: Cell, client: bytes, op: str, fields: dict[str, Any]) -> set[str | None]:
    """Codes of the refusals of a request, for each finger that it may name."""
    if op == "object.set":
        return {cell.code(op, client=client, **fields)}
    names = [fields["finger"]] if "finger" in fields else ["left", "right"]
    return {cell.code(op, client=client, **fields | {"finger": name}) for name in names}


@EACH
@pytest.mark.parametrize("leased", [True, False])
def test_A9_a_client_without_the_lease_makes_the_reflex_do_nothing(jaws: type[Jaws], leased: bool) -> None:
    cell, sent = held(jaws)
    if not leased:
        cell.ask("lease.release")
        cell.let_lease_be()
    for op, fields in STATED:
        codes = state(cell, b"eve", op, fields)
        assert codes <= {"no_lease", "lease_held", "in_contact"}, (op, codes)
        cell.run(500)
    assert sent == []
    assert cell.acts == []
    assert cell.jaws.grip_n == pytest.approx(6.0, abs=0.1)


@EACH
def test_A9_the_reflex_keeps_step_and_rate_and_spends_a_budget_of_its_own(jaws: type[Jaws]) -> None:
    cell, sent = held(jaws)
    since_ns, began_n = cell.now_ns, cell.jaws.grip_n
    cell.on_sent = lambda command: sent.append((cell.now_ns, command.force_n)) if command.force_n else None
    for finger in ("left", "right"):
        assert cell.code("friction.set", finger=finger, mu_s=0.02) is None, "the holder may"
    cell.run(2000)
    assert len(sent) > 2
    for t_ns, force_n in sent:
        assert force_n <= began_n + STEP_N + RAISE_N_PER_S * (t_ns - since_ns) * 1e-9 + 0.01
    assert cell.jaws.grip_n > began_n + 8.0
    codes = []
    for _ in range(round(BUDGET_N / STEP_N)):
        cell.run(300)
        codes.append(cell.code("grip.adjust", delta_n=STEP_N / 2))
    assert codes == [None] * len(codes), "what the reflex raised was not taken from the client's budget"


@pytest.mark.parametrize("key", ["friction_without_lease", "gravity_without_lease"])
def test_the_config_may_let_every_client_state_it(make_run: Callable[[str], Any], rig: str, key: str) -> None:
    run = make_run(f"{rig}\n[reflex]\nenabled = true\n{grasp_table()}\n[requests]\n{key} = true\n")
    run.up()
    friction, gravity = (None, ("no_lease", "")) if key.startswith("friction") else (("no_lease", ""), None)
    assert run.refusal("friction.set", finger="left", mu_s=0.3) == friction
    assert run.refusal("object.set", name="mug") == friction
    assert run.refusal("gravity.set", finger="left", gravity_mps2=[0.0, 0.0, -9.8]) == gravity
    assert run.refusal("tare.undo", finger="left") == ("no_lease", "")
    op, fields = STATED[2] if gravity else STATED[0]
    assert run.ask(op, **{"finger": "left"} | fields)["error"]["message"] == (
        f"the reflex acts on {op}, so that it may move the gripper: acquire the lease first (lease.acquire); "
        f"{op.partition('.')[0]}_without_lease = true in [requests] of the config frees it"
    )
