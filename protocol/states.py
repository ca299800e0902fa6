"""The states of an endpoint and the table of moves between them, alone.

Knows no role: the two sides differ in which triggers they meet, not in what a trigger does. Knows no time and no bytes.
"""

from enum import Enum, auto


class State(Enum):
    """Where a conversation with the peer stands."""

    IDLE = auto()
    """Nothing begun, or the last session has ended and the next one is about to begin."""
    CONNECTING = auto()
    """Calling the peer until it answers."""
    LISTENING = auto()
    """Waiting to be called."""
    ENGAGED = auto()
    """In a session, with a loop age (`protocol.liveness`) within the silence limit: each end hears the other."""
    SILENT = auto()
    """In a session whose loop age has passed the silence limit; it ends a few seconds later."""
    CLOSED = auto()
    """Over, by our own wish or because the peer refused. Final."""


class Trigger(Enum):
    """What can move an endpoint from one state to another."""

    DIAL = auto()
    LISTEN = auto()
    ESTABLISH = auto()
    FALL_SILENT = auto()
    EXPIRE = auto()
    HEAR = auto()
    LEAVE = auto()
    REFUSE = auto()
    CLOSE = auto()


class StateError(RuntimeError):
    """A call that the state of the endpoint does not allow: a fault of the caller, never of the peer."""


TABLE: dict[State, dict[Trigger, State]] = {
    State.IDLE: {
        Trigger.DIAL: State.CONNECTING,
        Trigger.LISTEN: State.LISTENING,
        Trigger.CLOSE: State.CLOSED,
    },
    State.CONNECTING: {
        Trigger.ESTABLISH: State.ENGAGED,
        Trigger.REFUSE: State.CLOSED,
        Trigger.CLOSE: State.CLOSED,
    },
    State.LISTENING: {
        Trigger.ESTABLISH: State.ENGAGED,
        Trigger.CLOSE: State.CLOSED,
    },
    State.ENGAGED: {
        Trigger.ESTABLISH: State.ENGAGED,
        Trigger.FALL_SILENT: State.SILENT,
        Trigger.LEAVE: State.IDLE,
        Trigger.CLOSE: State.CLOSED,
    },
    State.SILENT: {
        Trigger.ESTABLISH: State.ENGAGED,
        Trigger.HEAR: State.ENGAGED,
        Trigger.EXPIRE: State.IDLE,
        Trigger.LEAVE: State.IDLE,
        Trigger.REFUSE: State.CLOSED,
        Trigger.CLOSE: State.CLOSED,
    },
    State.CLOSED: {},
}


def next_state(state: State, trigger: Trigger) -> State:
    """Where `trigger` leads from `state`.

    Raises:
        StateError: if the table has no such move; the state is as before.
    """
    try:
        return TABLE[state][trigger]
    except KeyError:
        raise StateError(f"{trigger.name} is not possible while {state.name}") from None
