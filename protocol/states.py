"""The roles and states of an endpoint, and the table of moves between the states."""

from enum import Enum, auto

from weberlink.compiled import mypyc_attr


class Role(Enum):
    """Which end of the link an endpoint is; the value is its name in messages to the user."""

    INITIATOR = "master"
    RESPONDER = "slave"


class State(Enum):
    """State of the conversation with the peer."""

    IDLE = auto()  # not started, or the last session has ended and the next one is about to begin
    CONNECTING = auto()  # calling the peer until it answers
    LISTENING = auto()  # waiting to be called
    ENGAGED = auto()  # in a session within both limits (`Liveness`): each end hears the other
    SILENT = auto()  # in a session that has passed one of the limits; it ends a few seconds later
    CLOSED = auto()  # for good: closed by this end, or refused by the peer


@mypyc_attr(native_class=False)
class StateError(RuntimeError):
    """The state of the endpoint does not allow this call: a fault of the caller, never of the peer."""


MOVES: dict[State, tuple[State, ...]] = {
    State.IDLE: (State.CONNECTING, State.LISTENING, State.CLOSED),
    State.CONNECTING: (State.ENGAGED, State.CLOSED),
    State.LISTENING: (State.ENGAGED, State.CLOSED),
    State.ENGAGED: (State.ENGAGED, State.SILENT, State.IDLE, State.CLOSED),
    State.SILENT: (State.ENGAGED, State.IDLE, State.CLOSED),
    State.CLOSED: (),
}


def moved(state: State, target: State) -> State:
    """The state after a move; StateError if the table has no such move."""
    if target not in MOVES[state]:
        raise StateError(f"an endpoint that is {state.name} cannot become {target.name}")
    return target
