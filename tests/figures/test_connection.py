"""How long a side was in session, on states made by hand."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.examples import examples
from weberlink.figures.link import AWAY, CONNECTED, UNCONNECTED, ConnectionScore
from weberlink.figures.session import Records
from weberlink.protocol.session import EXPIRY
from weberlink.protocol.states import State
from weberlink.telemetry.reader import DTYPE

PERIOD = 0.01
LISTENING, CONNECTING, ENGAGED, SILENT, CLOSED = (
    State.LISTENING, State.CONNECTING, State.ENGAGED, State.SILENT, State.CLOSED,
)  # fmt: skip
Stretch = tuple[State, float]


def records(*stretches: Stretch) -> Records:
    """Records of states, each for some seconds."""
    states = [state.value for state, seconds in stretches for _ in range(round(seconds / PERIOD))]
    made = np.zeros(len(states), DTYPE)
    made["state"] = states
    made["at"] = 5.0 + np.arange(len(states)) * PERIOD
    return made


def summary(*stretches: Stretch) -> dict[str, Any]:
    score = ConnectionScore()
    score.add(records(*stretches))
    return vars(score.figures())


@pytest.mark.parametrize(
    ("stretches", "ended", "expected"),
    [
        ([(LISTENING, 2), (ENGAGED, 3), (CLOSED, 1)], CONNECTED, {"waited_s": 2, "connected_s": 3}),
        ([(ENGAGED, 2), (LISTENING, 4)], AWAY, {"connected_s": 2, "away_s": 4}),
        (
            [(ENGAGED, 2), (SILENT, EXPIRY), (LISTENING, 4)],
            UNCONNECTED,
            {"connected_s": 2, "unconnected_s": EXPIRY + 4, "last_s": EXPIRY + 4, "interruptions": 1},
        ),
        (
            [(ENGAGED, 1), (SILENT, 0.5), (ENGAGED, 1), (SILENT, 1), (ENGAGED, 1)],
            CONNECTED,
            {"connected_s": 3, "unconnected_s": 1.5, "interruptions": 2},
        ),
        (
            [(ENGAGED, 1), (SILENT, EXPIRY), (CONNECTING, 1), (ENGAGED, 1)],
            CONNECTED,
            {"unconnected_s": EXPIRY + 1, "interruptions": 1},
        ),
        ([(ENGAGED, 1), (SILENT, 0.5), (CONNECTING, 2)], AWAY, {"unconnected_s": 0.5, "away_s": 2}),
    ],
    ids=["orderly", "left", "lost", "interrupted", "returned", "left_while_silent"],
)
def test_states_are_counted_by_what_they_mean(stretches: list[Stretch], ended: str, expected: dict[str, float]) -> None:
    found = summary(*stretches)
    assert found["ended"] == ended
    for key, value in expected.items():
        assert found[key] == pytest.approx(value, abs=2 * PERIOD), key
    seconds = sum(found[key] for key in ("waited_s", "connected_s", "unconnected_s", "away_s"))
    assert seconds == pytest.approx(sum(s for state, s in stretches if state is not CLOSED), abs=2 * PERIOD)


@examples(50)
@given(
    st.lists(st.tuples(st.sampled_from(list(State)), st.floats(0.01, 4.0)), min_size=1, max_size=8),
    st.integers(1, 40),
)
def test_the_figures_do_not_depend_on_the_pieces(stretches: list[Stretch], pieces: int) -> None:
    made = records(*stretches)
    score = ConnectionScore()
    for piece in np.array_split(made, pieces):
        score.add(piece)
    whole = summary(*stretches)
    found = vars(score.figures())
    assert found.pop("ended") == whole.pop("ended")
    assert found == pytest.approx(whole)
