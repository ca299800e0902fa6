"""Both reference solvers on one stretch of motion: samples, guards, and what cannot be solved."""

from math import cos, pi, sin

import pytest

pytest.importorskip("scipy")

from weberlink.studies.precision.equations import State
from weberlink.studies.precision.reference import SOLVERS
from weberlink.studies.precision.smooth import Solver, Stretch

OMEGA = 1000.0


def swing(state: State) -> list[float]:
    return [*state[3:], -OMEGA * OMEGA * state[0], 0.0, -OMEGA * OMEGA * state[2]]


@pytest.fixture(params=list(SOLVERS))
def solve(request: pytest.FixtureRequest) -> Solver:
    return SOLVERS[str(request.param)]


def test_an_oscillation_is_right_inside_steps_and_at_the_end(solve: Solver) -> None:
    ticks = [0.0013 * n for n in range(1, 30)]
    outcome = solve(Stretch(swing, (), [1.0, 0.0, 0.0, 0.0, 0.0, 0.0], 0.0, 0.05, ticks))
    assert outcome.fallen is None
    assert outcome.at == 0.05
    assert outcome.state[0] == pytest.approx(cos(50.0), abs=1e-11)
    assert [state[0] for state in outcome.samples] == pytest.approx([cos(OMEGA * tick) for tick in ticks], abs=1e-11)


def test_the_first_guard_to_fall_ends_the_stretch(solve: Solver) -> None:
    guards = [lambda state: state[0] + 0.5, lambda state: state[0]]
    outcome = solve(Stretch(swing, guards, [1.0, 0.0, 0.0, 0.0, 0.0, 0.0], 0.0, 0.05, [0.001, 0.004]))
    assert outcome.fallen == 1
    assert outcome.at == pytest.approx(pi / 2.0 / OMEGA, abs=1e-14)
    assert outcome.state[3] == pytest.approx(-OMEGA * sin(pi / 2.0), rel=1e-11)
    assert len(outcome.samples) == 1


def test_a_guard_that_rises_through_zero_ends_nothing(solve: Solver) -> None:
    outcome = solve(Stretch(swing, [lambda state: -state[0]], [1.0, 0.0, 0.0, 0.0, 0.0, 0.0], 0.0, 0.003, [0.003]))
    assert outcome.fallen is None


def test_a_stiff_decay_costs_no_accuracy(solve: Solver) -> None:
    rate = 1e5

    def decay(state: State) -> list[float]:
        return [*state[3:], -rate * state[3], 0.0, 0.0]

    outcome = solve(Stretch(decay, (), [0.0, 0.0, 0.0, 1.0, 0.0, 0.0], 0.0, 0.01, [0.01]))
    assert outcome.state[0] == pytest.approx(1.0 / rate, rel=1e-9)
