"""The roles and states of an endpoint, and the table of moves between the states."""

from enum import Enum, auto

from weberlink.compiled import mypyc_attr


class Role(Enum):
    """Which end of the link an endpoint is; the value is its name in messages to the user."""

    INITIATOR = "master"
    RESPONDER = "slave"

    @property
    def other(self) -> "Role":
        return Role.RESPONDER if self is Role.INITIATOR else Role.INITIATOR


class State(Enum):
    """State of the conversation with the peer."""

    IDLE = auto()
    """Not started, or the last session has ended and the next one is about to begin."""
    CONNECTING = auto()
    """Calling the peer until it answers."""
    LISTENING = auto()
    """Waiting to be called."""
    ENGAGED = auto()
    """In a session within both limits (`Liveness`): each end hears the other."""
    SILENT = auto()
    """In a session that has passed one of the limits; it ends a few seconds later."""
    CLOSED = auto()
    """Closed by this end, or refused by the peer. Final."""


class Trigger(Enum):
    """Event that moves an endpoint from one state to another."""

    DIAL = auto()
    LISTEN = auto()
    ESTABLISH = auto()
    FALL_SILENT = auto()
    EXPIRE = auto()
    HEAR = auto()
    LEAVE = auto()
    REFUSE = auto()
    CLOSE = auto()


@mypyc_attr(native_class=False)
class StateError(RuntimeError):
    """The state of the endpoint does not allow this call: a fault of the caller, never of the peer."""


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
    """The state that `trigger` leads to.

    Raises:
        StateError: if the table has no such move; the state stays as it was.
    """
    try:
        return TABLE[state][trigger]
    except KeyError:
        raise StateError(f"{trigger.name} is not possible while {state.name}") from None
