"""Every predictor with every control scheme, deadband shape and number of degrees of freedom: each keeps its laws.

The suite takes combinations in which every pair of choices occurs; a hunt takes them all.
"""

from itertools import combinations, product

import numpy as np
import pytest

from tests.session.systems import configuration
from weberlink.codec import choice
from weberlink.codec.deadband import DEADBANDS
from weberlink.codec.predictors import PREDICTORS
from weberlink.geometry.vector import distance
from weberlink.protocol.states import State
from weberlink.session.composition.channels import force_deadband
from weberlink.session.simulation import build_simulation
from weberlink.telemetry.record import FORCE

pytestmark = pytest.mark.hypothesis  # so that `make hunt` runs it

RATE = 500.0
SECONDS = 0.4
SCHEMES = ("none", "bounded")
FILES: dict[object, str] = {3: "scene-height-field.yaml", 6: "rotation.yaml"}
CHOICES = ((*PREDICTORS, *choice.CHOICES), SCHEMES, tuple(DEADBANDS), tuple(FILES))
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


def test_run_is_finite_and_limited_and_within_the_deadband(combination: Combination) -> None:
    predictor, scheme, shape, axes = combination
    coded = (f"codec.force.predictor={predictor}", f"codec.force.deadband.shape={shape}", "codec.force.floor_n=0.02")
    linked = (f"control.scheme={scheme}", f"rate_hz={RATE:g}", "link.emulate.delay_ms=3", PRESSED)
    settings = configuration(*coded, *linked, file=FILES[axes])
    limit, force = settings.system.master.limits.force_n, settings.system.codec.force
    error = force_deadband(force, settings.system.tick_period, force.weber).error
    simulation = build_simulation(settings)
    master, slave = simulation.advance(round(SECONDS * RATE))
    for values in (master["output"], slave["output"], slave["raw"]):
        assert np.isfinite(values).all()
    felt = np.linalg.norm(master["output"][:, FORCE], axis=1)
    assert felt.max() <= limit * (1.0 + 1e-9)
    unsent = slave[(slave["state"] == State.ENGAGED.value) & (slave["ramping"] == 0) & (slave["sent"] == 0)]
    vectors = (map(tuple, unsent[name][:, FORCE].tolist()) for name in ("decoded", "raw"))
    for decoded, raw, bound in zip(*vectors, unsent["bound"].tolist(), strict=True):
        assert error(decoded, raw) <= bound or distance(decoded, raw) <= force.step_n
    assert simulation.master.failure is None
    assert simulation.master.endpoint.state is State.ENGAGED
    assert felt.max() > 0.05 and unsent["raw"][:, FORCE].any(axis=1).sum() > 20, "the hand hardly felt the surface"
