from itertools import product

import pytest

from weberlink.protocol.states import TABLE, State, StateError, Trigger, next_state


def test_every_state_can_be_reached_and_left_by_the_moves_of_the_table_alone() -> None:
    reached = {State.IDLE}
    for _ in State:
        reached |= {target for state in reached for target in TABLE[state].values()}
    assert reached == set(State) == set(TABLE)
    assert TABLE[State.CLOSED] == {}
    assert all(State.CLOSED in TABLE[state].values() for state in State if state is not State.CLOSED)
    for state, trigger in product(State, Trigger):
        if trigger in TABLE[state]:
            assert next_state(state, trigger) is TABLE[state][trigger]
        else:
            with pytest.raises(StateError, match=f"{trigger.name} .* {state.name}"):
                next_state(state, trigger)
