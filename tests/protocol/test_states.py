from itertools import product

import pytest

from weberlink.protocol.states import MOVES, State, StateError, moved


def test_every_state_can_be_reached_and_left_by_the_moves_of_the_table_alone() -> None:
    reached = {State.IDLE}
    for _ in State:
        reached |= {target for state in reached for target in MOVES[state]}
    assert reached == set(State) == set(MOVES)
    assert MOVES[State.CLOSED] == ()
    assert all(State.CLOSED in MOVES[state] for state in State if state is not State.CLOSED)
    for state, target in product(State, State):
        if target in MOVES[state]:
            assert moved(state, target) is target
        else:
            with pytest.raises(StateError, match=f"{state.name} .* {target.name}"):
                moved(state, target)
