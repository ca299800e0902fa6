"""Reference solver one: the explicit method of order 8 by Dormand and Prince, with step control. Needs scipy.

Hairer, Norsett, Wanner, "Solving Ordinary Differential Equations I", as in `scipy.integrate.DOP853`.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from weberlink.studies.precision.equations import State
from weberlink.studies.precision.smooth import Outcome, Stretch

RELATIVE = 3e-14  # the method accepts no less than 100 roundings
ABSOLUTE = (1e-17, 1e-17, 1e-17, 1e-15, 1e-15, 1e-15)  # [m], [m/s]

Array = NDArray[np.float64]


def solve(stretch: Stretch) -> Outcome:
    """As `Solver`."""
    answer = solve_ivp(
        lambda _, state: stretch.field(state.tolist()),
        (stretch.begin, stretch.end),
        np.array(stretch.state),
        method="DOP853",
        t_eval=[*stretch.ticks, *([] if stretch.end in stretch.ticks else [stretch.end])],
        events=[falling(guard) for guard in stretch.guards],
        rtol=RELATIVE,
        atol=ABSOLUTE,
    )
    if answer.status < 0:
        raise ArithmeticError(f"DOP853: {answer.message}")
    samples = np.transpose(answer.y).tolist()  # scipy hands out an empty list before the first tick
    for index, (times, states) in enumerate(zip(answer.t_events or (), answer.y_events or (), strict=True)):
        if len(times):
            return Outcome(samples, float(times[0]), states[0].tolist(), index)
    return Outcome(samples[: len(stretch.ticks)], stretch.end, samples[-1], None)


def falling(guard: Callable[[State], float]) -> Callable[[float, Array], float]:
    """The guard as scipy wants an event that ends the integration."""

    def event(_: float, state: Array) -> float:
        return guard(state.tolist())

    event.terminal = True  # type: ignore[attr-defined]
    event.direction = -1.0  # type: ignore[attr-defined]
    return event
