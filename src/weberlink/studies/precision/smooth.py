"""What a reference solver is asked: one stretch of smooth motion, up to its end or to the first guard that falls."""

from collections.abc import Callable, Sequence
from typing import NamedTuple, Protocol

from weberlink.studies.precision.equations import State


class Stretch(NamedTuple):
    """An initial value problem between two events.

    Args:
        field: d(state)/dt.
        guards: functions of the state; the stretch ends where the first of them falls below zero.
        state: at `begin`.
        begin: [s].
        end: [s], more than `begin`.
        ticks: times in (begin, end] at which the state is wanted, ascending [s].
    """

    field: Callable[[State], list[float]]
    guards: Sequence[Callable[[State], float]]
    state: State
    begin: float
    end: float
    ticks: Sequence[float]


class Outcome(NamedTuple):
    """States at the ticks reached; when [s], where and by which guard the stretch ended (None: by its own end)."""

    samples: list[list[float]]
    at: float
    state: list[float]
    fallen: int | None


class Solver(Protocol):
    def __call__(self, stretch: Stretch) -> Outcome:
        """Raises ArithmeticError where the accuracy cannot be reached."""
        ...
