"""What leaves at either end, against a peer that holds the keys: one of many runs of `trials.safety.gate`."""

import pytest

from tests.compiled import replaces_methods
from tests.session.hostile import Content, Duel
from tests.session.systems import configuration
from trials.safety.gate import OVERRIDES, cases, exceeded, run
from weberlink.protocol.events import UpdateReceived
from weberlink.session.side import Side

pytestmark = replaces_methods
UPDATES = 800


@pytest.mark.parametrize(("kind", "end"), cases())
def test_in_random_sessions_every_tick_is_within_every_limit(kind: str, end: str) -> None:
    largest = run(kind, end, 1, UPDATES)
    assert exceeded(largest) == []
    nearest = [value / limit for limit, value in largest.values() if limit > 0.0]
    assert max(nearest) == pytest.approx(1.0), "the peer reaches a limit"


@pytest.mark.parametrize("end", ["master", "slave"])
@pytest.mark.parametrize("stall_ms", [15, 60, 70, 90])
def test_the_play_out_uses_nothing_beyond_the_age_limit(end: str, stall_ms: int) -> None:
    """A process that stands still finds updates that have waited meanwhile."""
    playout_ms, predictors = 50, ("codec.force.predictor=zoh", "codec.position.predictor=zoh")
    duel = Duel(configuration(*OVERRIDES, *predictors, f"link.playout_ms={playout_ms}"), end)
    duel.peer.report_encoding(0.0, is_encoding=True)
    duel.engage()
    ages = []  # of each update as it is used [ticks]

    def applied(event: UpdateReceived) -> None:
        ages.append(duel.index - event.update.tick)
        Side._apply(duel.side, event)

    duel.side._apply = applied  # type: ignore[method-assign]
    for tick in range(200):
        duel.update(Content(0, 0, 0, (tick,), None))
        duel.tick()
    assert set(ages) == {playout_ms}
    duel.index += stall_ms
    for tick in range(100):
        duel.update(Content(0, 0, 0, (tick,), None))
        duel.tick()
    limit = 1e3 * duel.side.endpoint.liveness.limit
    assert max(ages) <= limit
    assert max(ages) >= min(limit, playout_ms + stall_ms) - 1, "what is in time is used"
    assert ages[-1] == playout_ms


def test_what_waits_when_the_master_lets_go_is_never_used() -> None:
    duel = Duel(configuration(*OVERRIDES, "codec.position.predictor=zoh", "link.playout_ms=40"), "slave")
    duel.engage()
    held = []
    for tick in range(200):
        leads = tick < 100
        duel.peer.report_encoding(duel.now, is_encoding=leads)
        assert not leads or duel.update(Content(0, 0, 0, (tick,), None))
        duel.tick()
        held.append(duel.side.incoming[0].decoder.newest is not None)
    assert held == [False] * 40 + [True] * 60 + [False] * 100
