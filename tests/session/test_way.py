"""The way of a force sample is the one of docs/architecture.md; an update leaves, and is applied, between its parts."""

import re
import sys
from types import FrameType
from typing import Any

import pytest

from tests.program import ROOT
from weberlink.compiled import is_compiled
from weberlink.config import load
from weberlink.protocol.aio import sockets, udp
from weberlink.session.simulation import MASTER_ADDRESS, Simulation, build_simulation

SETTLE_TICKS = 1500
TICKS = 6000
SOCKETS = {"Paths.send": udp.Paths.send, "ReceiveQueue.read": sockets.ReceiveQueue.read}
"""In virtual time the emulated link is in their place."""
TICK = ("session/side.py", "session/simulation.py")  # call the parts of a tick; what they pass on is in no other object

Call = tuple[str, list[str]]  # a function, and the modules of its callers up to the tick


def told() -> list[str]:
    text = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| (\d+) \| `([\w.]+)` \|", text, re.MULTILINE)
    assert [int(number) for number, _ in rows] == list(range(1, len(rows) + 1))
    return [name for _, name in rows]


def calls(step: Any) -> list[Call]:
    """All calls of functions of this project during a step."""
    found: list[Call] = []

    def module(frame: FrameType) -> str:
        return "/".join(frame.f_code.co_filename.split("/")[-2:])

    def note(frame: FrameType, event: str, _: Any) -> None:
        if event == "call" and "site-packages" not in frame.f_code.co_filename:
            callers, caller = [], frame
            while caller.f_back is not None and module(caller) not in TICK:
                caller = caller.f_back
                callers.append(module(caller))
            found.append((frame.f_code.co_qualname, [module(frame), *callers]))

    sys.setprofile(note)
    try:
        step()
    finally:
        sys.setprofile(None)
    return found


def update_sent_and_taken(simulation: Simulation) -> list[Call]:
    """The calls of the tick in which the robot's end sends a force, and of the next one."""
    for _ in range(SETTLE_TICKS):
        simulation.step()
    for _ in range(TICKS):
        before = simulation.slave.endpoint.statistics.updates_sent[0]
        made = calls(simulation.step)
        if simulation.slave.endpoint.statistics.updates_sent[0] > before:
            return made + calls(simulation.step)
    raise AssertionError("no force was sent")


@pytest.mark.skipif(is_compiled(), reason="compiled code calls without Python frames")
def test_a_force_goes_the_way_of_the_table_and_no_module_between() -> None:
    made = update_sent_and_taken(build_simulation(load(ROOT / "configs" / "loopback.yaml")))
    names = [name for name in told() if name not in SOCKETS]
    last, way = -1, []
    for name in names:
        last = next(i for i, call in enumerate(made) if i > last and call[0] == name)
        way.append(made[last])
    modules = {call[1][0] for call in way} | set(TICK)
    assert {of for _, callers in way for of in callers} <= modules


def by_hand(*overrides: str) -> Simulation:
    """Tick the master alone until it has sent an update, and carry that to the slave."""
    simulation = build_simulation(load(ROOT / "configs" / "loopback.yaml", overrides))
    for _ in range(SETTLE_TICKS):
        simulation.step()
    master, slave = simulation.master, simulation.slave
    for index in range(SETTLE_TICKS, SETTLE_TICKS + TICKS):
        now = 0.001 * index
        master.tick(index, now, now)
        for data, _ in master.endpoint.datagrams_to_send():
            slave.endpoint.receive_datagram(data, MASTER_ADDRESS, now)
        if master.outgoing[0].update is not None:
            return simulation
        slave.tick(index, now, now)
    raise AssertionError("no position was sent")


@pytest.mark.parametrize("playout_ms", [0, 20])
def test_an_update_is_applied_as_it_comes_unless_it_is_to_be_played_out(playout_ms: int) -> None:
    simulation = by_hand(f"link.playout_ms={playout_ms}")
    update, newest = simulation.master.outgoing[0].update, simulation.slave.incoming[0].decoder.newest
    assert update is not None
    assert newest is not None
    assert (newest.tick == update.tick) is (playout_ms == 0)


@pytest.mark.skipif(is_compiled(), reason="compiled code calls without Python frames")
def test_an_update_leaves_before_the_hand_is_commanded() -> None:
    def sending(simulation: Simulation) -> list[str]:
        master = simulation.master
        master.send_at_once = lambda _now: None
        return [name.rpartition(".")[2] for name, _ in calls(simulation.step)]

    simulation = by_hand()
    made = next(made for _ in range(TICKS) if "<lambda>" in (made := sending(simulation)))
    assert made.index("_send") < made.index("<lambda>") < made.index("_actuate")
