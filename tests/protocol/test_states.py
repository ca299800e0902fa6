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


@pytest.mark.parametrize("state", State)
@pytest.mark.parametrize("trigger", Trigger)
def test_a_move_is_in_the_table_or_refused(state: State, trigger: Trigger) -> None:
    if trigger in TABLE[state]:
        assert next_state(state, trigger) is TABLE[state][trigger]
    else:
        with pytest.raises(StateError, match=f"{trigger.name} .* {state.name}"):
            next_state(state, trigger)
