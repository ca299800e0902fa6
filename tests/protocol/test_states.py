from itertools import product

import pytest

from weberlink.protocol.states import TABLE, State, StateError, Trigger, next_state


def test_every_state_has_a_row_and_closed_is_final() -> None:
    assert set(TABLE) == set(State)
    assert TABLE[State.CLOSED] == {}


def test_every_state_can_be_reached_and_left() -> None:
    reached = {State.IDLE}
    for _ in State:
        reached |= {target for state in reached for target in TABLE[state].values()}
    assert reached == set(State)
    assert all(State.CLOSED in TABLE[state].values() for state in State if state is not State.CLOSED)


def test_a_move_outside_the_table_is_refused() -> None:
    assert next_state(State.IDLE, Trigger.DIAL) is State.CONNECTING
    for state, trigger in product(State, Trigger):
        if trigger not in TABLE[state]:
            with pytest.raises(StateError, match=f"{trigger.name} .* {state.name}"):
                next_state(state, trigger)
