"""Look-ahead decides later, and play-out uses later: by how much, and what is never used."""

import numpy as np
import pytest

from tests.session.kinds import HAND, run
from weberlink.protocol.states import State
from weberlink.session.simulation import Simulation

JITTER = ("control.scheme=none", "link.emulate={delay_ms: 10, jitter_ms: 15, seed: 3}")


def ages(*overrides: str) -> list[float]:
    """For each position update that the slave has used, the ticks since its sample."""
    found: dict[int, float] = {}

    def look(simulation: Simulation) -> None:
        newest, index = simulation.slave.incoming[0].decoder.newest, simulation.slave.index
        if newest is not None and index > 1000:
            found.setdefault(newest.tick, index - newest.tick)

    run(HAND, 2.0, *JITTER, *overrides, watch=look)
    _, *ages = found.values()  # the first was in use before
    assert len(ages) > 20
    return ages


@pytest.mark.parametrize("playout", [15, 20])
def test_updates_are_used_at_a_constant_age(playout: int) -> None:
    plain, smooth = ages(), ages(f"link.playout_ms={playout}")
    assert max(plain) - min(plain) > 8
    assert max(smooth) - min(smooth) <= 1
    assert 10 + playout <= max(smooth) <= 13 + playout, "the least delay of 10 ms, and the play-out"


def test_what_is_decided_on_was_measured_that_long_ago() -> None:
    slave = run(HAND, 1.5, "codec.force.lookahead_ms=20", "codec.position.lookahead_ms=5").slave
    decided = np.flatnonzero(
        (slave["state"] == State.ENGAGED.value) & (slave["ramping"] == 0) & (slave["coded"][:, 2] != 0.0)
    )
    assert len(decided) > 100
    assert (slave["coded"][decided] == slave["raw"][decided - 20]).all()


def test_what_is_decoded_is_where_the_hand_was_that_long_ago() -> None:
    ran = run(HAND, 1.0, "control.scheme=none", "link.emulate={delay_ms: 10}", "link.playout_ms=20")
    moving = np.arange(500, 900)
    errors = {
        lag: float(np.abs(ran.slave["position"][moving] - ran.master["raw"][moving - lag]).max())
        for lag in range(-30, 60)
    }
    assert min(errors, key=errors.__getitem__) == pytest.approx(30, abs=3)
