"""Every predictor with every control scheme, deadband shape and number of degrees of freedom: each keeps its laws.

The suite takes combinations in which every pair of choices occurs; a hunt takes them all.
"""

from itertools import combinations, product
from math import isfinite

import pytest

from tests.session.systems import configuration, decoded, output, raw, steps
from weberlink.codec.predictors import BANKS, PREDICTORS
from weberlink.geometry.vector import distance, norm
from weberlink.protocol.states import State
from weberlink.session.composition.channels import force_deadband
from weberlink.session.simulation import build_simulation

pytestmark = pytest.mark.hypothesis  # so that `make hunt` runs it

RATE = 500.0
SECONDS = 0.4
SCHEMES = ("none", "bounded")
DEADBANDS = ("isotropic", "cone", "level_crossing", "velocity_adaptive")
FILES: dict[object, str] = {3: "scene-height-field.yaml", 6: "rotation.yaml"}
CHOICES = ((*PREDICTORS, *BANKS), SCHEMES, DEADBANDS, tuple(FILES))
PRESSED = (
    "master.device.script=[{motion: reach, to_m: [0.0, 0.0, -0.008], duration_s: 0.15},"
    " {motion: reach, to_m: [0.01, 0.0, -0.008], duration_s: 0.15}]"
)
Combination = tuple[object, ...]
Pair = tuple[tuple[int, object], tuple[int, object]]


def pairs(combination: Combination) -> set[Pair]:
    return set(combinations(enumerate(combination), 2))


def covering(left: list[Combination]) -> list[Combination]:
    """Combinations in which every pair of choices occurs that occurs in any, those with the most new pairs first."""
    missing = set().union(*map(pairs, left))
    chosen: list[Combination] = []
    while missing:
        best = max(left, key=lambda each: len(pairs(each) & missing))
        chosen.append(best)
        missing -= pairs(best)
    return chosen


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    if "combination" in metafunc.fixturenames:
        every = list(product(*CHOICES))
        chosen = every if metafunc.config.option.hunt else covering(every)
        metafunc.parametrize("combination", chosen, ids=lambda each: "-".join(map(str, each)))


def overridden(combination: Combination) -> tuple[str, ...]:
    predictor, scheme, shape, _ = combination
    return (
        f"codec.force.predictor={predictor}",
        f"control.scheme={scheme}",
        f"codec.force.deadband.shape={shape}",
        "codec.force.floor_n=0.02",
        f"rate_hz={RATE:g}",
        "link.emulate.delay_ms=3",
        PRESSED,
    )


def test_run_is_finite_and_limited_and_within_the_deadband(combination: Combination) -> None:
    settings = configuration(*overridden(combination), file=FILES[combination[-1]])
    limit, force = settings.system.master.limits.force_n, settings.system.codec.force
    error = force_deadband(force, settings.system.tick_period, force.weber).error
    simulation = build_simulation(settings)
    felt, unsent = 0.0, 0
    for step in steps(simulation, SECONDS, RATE):
        values = (*output(step.master), *output(step.slave), *raw(step.slave))
        assert all(map(isfinite, values)), step
        assert norm(output(step.master)) <= limit * (1.0 + 1e-9)
        felt = max(felt, norm(output(step.master)))
        slave = step.slave
        if slave.state == State.ENGAGED.value and not (slave.ramping or slave.sent):
            apart = error(decoded(slave), raw(slave))
            assert apart <= slave.bound or distance(decoded(slave), raw(slave)) <= force.step_n, step
            unsent += norm(raw(slave)) > 0.0
    assert simulation.master.failure is None
    assert simulation.master.endpoint.state is State.ENGAGED
    assert felt > 0.05 and unsent > 20, "the hand hardly felt the surface"
