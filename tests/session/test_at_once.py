"""What leaves and what comes between the parts of a tick: an update goes out before the hand is commanded, and one that
comes is applied at once."""

from collections.abc import Callable
from typing import Any

import pytest

from tests.program import ROOT
from tests.session.test_way import calls
from weberlink.compiled import is_compiled
from weberlink.config import load
from weberlink.session.simulation import MASTER_ADDRESS, Simulation, build_simulation

SETTLED, MOST_TICKS = 1500, 3000


def by_hand(*overrides: str, wrap: Callable[[Callable[[], None]], Any] = lambda step: step()) -> tuple[Any, Simulation]:
    """Tick the master alone until it has sent an update, and carry that to the slave; what `wrap` made of that tick."""
    simulation = build_simulation(load(ROOT / "configs" / "loopback.yaml", overrides))
    for _ in range(SETTLED):
        simulation.step()
    master, slave = simulation.master, simulation.slave
    for index in range(SETTLED, SETTLED + MOST_TICKS):
        now = 0.001 * index
        made = wrap(lambda index=index, now=now: master.tick(index, now, now))
        for data, _ in master.endpoint.datagrams_to_send():
            slave.endpoint.receive_datagram(data, MASTER_ADDRESS, now)
        if master.outgoing[0].update is not None:
            return made, simulation
        slave.tick(index, now, now)
    raise AssertionError("no position was sent")


@pytest.mark.parametrize("playout_ms", [0, 20])
def test_an_update_is_applied_as_it_comes_unless_it_is_to_be_played_out(playout_ms: int) -> None:
    _, simulation = by_hand(f"link.playout_ms={playout_ms}")
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

    _, simulation = by_hand()
    made = next(made for _ in range(MOST_TICKS) if "<lambda>" in (made := sending(simulation)))
    assert made.index("_send") < made.index("<lambda>") < made.index("_actuate")
