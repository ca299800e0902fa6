"""Reference solvers for a stretch of smooth motion between two events. Needs scipy (extra: studies).

`dop853` is the explicit method of order 8 by Dormand and Prince (Hairer, Norsett, Wanner, "Solving Ordinary
Differential Equations I"). `closed_form` is the matrix exponential of motion whose field is affine, as between events
on flat faces. `lsoda` is the multistep method of Hindmarsh and Petzold, for the rest. They share no code.
"""

from collections.abc import Callable, Sequence
from functools import partial
from math import pi
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from weberlink_studies.precision.equations import MotionState

RELATIVE = 3e-14  # the smallest tolerance that scipy accepts is 100 roundings
ABSOLUTE = (1e-17, 1e-17, 1e-17, 1e-15, 1e-15, 1e-15)  # [m], [m/s]
LOOKS = 64  # times in a period or time constant at which `closed_form` evaluates the guards, and the least in a stretch
CHUNK = 256

Array = NDArray[np.floating[Any]]


class Stretch(NamedTuple):
    """An initial value problem between two events."""

    field: Callable[[MotionState], list[float]]  # d(state)/dt
    # functions of the state; the stretch ends where the first of them falls below zero
    guards: Sequence[Callable[[MotionState], float]]
    state: MotionState  # at `begin`
    begin: float  # [s]
    end: float  # [s], more than `begin`
    ticks: Sequence[float]  # times in (begin, end] at which the state is wanted, ascending [s]


class Outcome(NamedTuple):
    """States at the ticks reached; time [s], state and guard of the end (None: no guard fell)."""

    samples: list[list[float]]
    at: float
    state: list[float]
    fallen: int | None


class Solver(Protocol):
    def __call__(self, stretch: Stretch) -> Outcome:
        """Solve one stretch.

        Raises:
            ArithmeticError: if the accuracy cannot be reached.
        """
        ...


def integrated(method: str, stretch: Stretch) -> Outcome:
    """Solve with a method of scipy; see `Solver`."""
    from scipy.integrate import solve_ivp  # noqa: PLC0415 - an extra, imported where it is needed

    answer = solve_ivp(
        lambda _, state: stretch.field(state.tolist()),
        (stretch.begin, stretch.end),
        np.array(stretch.state),
        method=method,
        t_eval=[*stretch.ticks, *([] if stretch.end in stretch.ticks else [stretch.end])],
        events=[falling(guard) for guard in stretch.guards],
        rtol=RELATIVE,
        atol=ABSOLUTE,
    )
    if answer.status < 0:
        raise ArithmeticError(f"{method}: {answer.message}")
    samples = np.transpose(answer.y).tolist()  # scipy returns an empty list before the first tick
    for index, (times, states) in enumerate(zip(answer.t_events or (), answer.y_events or (), strict=True)):
        if len(times):
            return Outcome(samples, float(times[0]), states[0].tolist(), index)
    return Outcome(samples[: len(stretch.ticks)], stretch.end, samples[-1], None)


dop853: Solver = partial(integrated, "DOP853")
lsoda: Solver = partial(integrated, "LSODA")


def falling(guard: Callable[[MotionState], float]) -> Callable[[float, Array], float]:
    """The guard as a terminal event of scipy."""

    def event(_: float, state: Array) -> float:
        return guard(state.tolist())

    event.terminal = True  # type: ignore[attr-defined]
    event.direction = -1.0  # type: ignore[attr-defined]
    return event


def closed_form(stretch: Stretch) -> Outcome:
    """Solve x' = A x + b as exp(G t) (x, 1) with G = ((A, b), (0, 0)); see `Solver`."""
    from scipy.linalg import expm, matrix_balance  # noqa: PLC0415
    from scipy.optimize import brentq  # noqa: PLC0415

    field, guards = stretch.field, stretch.guards
    constant = np.array(field([0.0] * 6))
    generator = np.zeros((7, 7))
    generator[:6, 6] = constant
    generator[:6, :6] = np.transpose([np.array(field(unit)) - constant for unit in np.eye(6).tolist()])
    # In units in which position and velocity are alike large, the exponential loses less to rounding.
    balanced, units = matrix_balance(generator, permute=False)
    start = np.linalg.solve(units, [*stretch.state, 1.0])

    def states(times: Array) -> list[list[float]]:
        flows = expm(balanced * (times - stretch.begin)[:, None, None])
        found: list[list[float]] = ((flows @ start) @ units.T)[:, :6].tolist()
        return found

    def value(time: float, guard: Callable[[MotionState], float]) -> float:
        return guard(states(np.array([time]))[0])

    eigenvalues = np.linalg.eigvals(generator)
    span = stretch.end - stretch.begin
    step = min(span / LOOKS, 2.0 * pi / (LOOKS * max(float(np.abs(eigenvalues.imag).max()), 1e-9)))
    fastest = 1.0 / (LOOKS * max(float(np.abs(eigenvalues.real).max()), 1.0 / step))
    looks = np.concatenate([np.arange(0.0, span, step), np.geomspace(fastest, step, LOOKS), np.array([span])])
    times = stretch.begin + np.unique(looks)
    before = list(stretch.state)
    for first in range(1, len(times), CHUNK):
        for place, after in enumerate(states(times[first : first + CHUNK]), start=first):
            falls = [
                (float(brentq(value, times[place - 1], times[place], args=(guard,), xtol=1e-18)), index)
                for index, guard in enumerate(guards)
                if guard(before) >= 0.0 > guard(after)
            ]
            if falls:
                at, index = min(falls)
                reached = np.array([tick for tick in stretch.ticks if tick <= at])
                return Outcome(states(reached) if len(reached) else [], at, states(np.array([at]))[0], index)
            before = after
    return Outcome(states(np.array(stretch.ticks)), stretch.end, states(np.array([stretch.end]))[0], None)
