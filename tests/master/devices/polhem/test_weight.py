"""The weight of the links: the derivative of their height, and the formula of the makers for the five-bar linkage."""

from itertools import product
from math import acos, cos, hypot, pi, radians, sin

import pytest

from weberlink.geometry.vector import norm
from weberlink.master.devices.polhem.drive import Angles
from weberlink.master.devices.polhem.force_stage import ForceStage
from weberlink.master.devices.polhem.parameters import PARAMETERS, Parameters
from weberlink.master.devices.polhem.weight import GRAVITY_M_S2

WITH_MASSES = [each for each in PARAMETERS.values() if each.mechanism.weight is not None]
with_masses = pytest.mark.parametrize("parameters", WITH_MASSES, ids=[each.name for each in WITH_MASSES])


def test_the_sets_with_masses() -> None:
    assert {each.name for each in WITH_MASSES} == {
        "woodenhaptics_2015", "woodenhaptics_2019", "polhem_v1", "polhem_v2", "polhem_v3",
    }  # fmt: skip


@pytest.mark.parametrize(("b", "c"), [(0.0, 1.6), (0.4, 1.2), (0.9, 0.5), (-0.2, 2.0)])
def test_the_parallelogram_is_carried_by_the_derivative_of_its_height(b: float, c: float) -> None:
    weight = PARAMETERS["woodenhaptics_2015"].mechanism.weight
    assert weight is not None

    def energy(b: float, c: float) -> float:
        return GRAVITY_M_S2 * (0.170 * 0.051 * cos(b) + 0.110 * (0.205 * cos(b) - 0.091 * cos(c)))

    step = 1e-5
    by_b = (energy(b + step, c) - energy(b - step, c)) / (2.0 * step)
    by_c = (energy(b, c + step) - energy(b, c - step)) / (2.0 * step)
    assert weight.torques((0.3, b, c)) == pytest.approx((0.0, by_b, by_c), abs=1e-8)


def published_centres(t2: float, t3: float) -> list[tuple[float, float]]:
    """Centres of mass [m] and masses as hfab_polhem.h computes them, with lambda of the geometry: height and mass."""
    l0, l1, l2, l3, l4 = 0.034, 0.165, 0.025, 0.190, 0.034
    lam = PARAMETERS["polhem_v3"].mechanism.linkage.forearm((0.0, t2, t3))
    joint = (l1 * cos(t2) + l0 / 2, l1 * sin(t2))
    end = (joint[0] - l4 * cos(lam), joint[1] - l4 * sin(lam))
    from_a = hypot(end[0] + l0 / 2, end[1])
    a3 = acos((l2**2 + l3**2 - from_a**2) / (2 * l2 * l3)) - pi

    def turned(angle: float, x: float, y: float) -> tuple[float, float]:
        return (cos(angle) * x - sin(angle) * y, sin(angle) * x + cos(angle) * y)

    x3, y3 = turned(a3, 0.087765, 0.001978)
    x45, y45 = turned(lam - t2, 0.061701, 0.000576)
    return [
        (turned(t2, 0.030123, 0.000484)[1], 0.15764),
        (turned(t3, -0.004086, 0.001911)[1], 0.07733),
        (turned(t3, x3 + l2, y3)[1], 0.09767),
        (turned(t2, x45 + l1, y45)[1], 0.11265),
    ]


def links_meet(angles: Angles) -> bool:
    _, t2, t3 = angles
    lam = PARAMETERS["polhem_v3"].mechanism.linkage.forearm(angles)
    across = 0.034 + 0.165 * cos(t2) - 0.034 * cos(lam) - 0.025 * cos(t3)
    up = 0.165 * sin(t2) - 0.034 * sin(lam) - 0.025 * sin(t3)
    return abs(hypot(across, up) - 0.190) < 1e-9


def test_the_five_bar_is_carried_as_its_makers_carry_it() -> None:
    weight = PARAMETERS["polhem_v3"].mechanism.weight
    assert weight is not None
    compared, step = 0, 1e-4
    for t2, t3 in product(range(50, 126, 15), range(130, 220, 15)):
        angles: Angles = (0.0, radians(t2), radians(t3))
        if not links_meet(angles):
            continue

        def energy(by_2: float, by_3: float, at: Angles = angles) -> float:
            return 9.81 * sum(height * mass for height, mass in published_centres(at[1] + by_2, at[2] + by_3))

        by_2 = (energy(step, 0.0) - energy(-step, 0.0)) / (2.0 * step)
        by_3 = (energy(0.0, step) - energy(0.0, -step)) / (2.0 * step)
        assert weight.torques(angles) == pytest.approx((0.0, by_2, by_3), abs=1e-5)
        compared += 1
    assert compared > 20


def test_a_polhem_weighs_about_a_newton_at_the_handle() -> None:
    mechanism = PARAMETERS["polhem_v3"].mechanism
    carrying = mechanism.carrying_force(mechanism.counts_at((0.0, 0.0, 0.0)))
    assert norm(carrying) == pytest.approx(1.1, abs=0.1)
    assert carrying[2] > 0.0


@with_masses
def test_the_weight_does_not_exceed_the_limits(parameters: Parameters) -> None:
    """The sum of the commanded force and the weight is cut; without permission nothing is carried."""
    mechanism = parameters.mechanism
    middle = mechanism.counts_at((0.0, 0.0, 0.0))
    for force_n, current_ma in ((2.0, 6000.0), (0.5, 6000.0), (5.0, 100.0)):
        stage = ForceStage(mechanism, force_n, current_ma, carry=True)
        for force in ((0.0, 0.0, 0.0), (0.0, 0.0, 50.0), (3.0, -3.0, -3.0)):
            currents = stage.currents_ma(force, middle, 1.0)
            assert norm(mechanism.force(currents, middle)) < force_n + 1e-3, "whole milliamperes"
            assert max(map(abs, currents)) <= current_ma
        assert stage.currents_ma((0.0, 0.0, 0.0), middle, 0.0) == (0, 0, 0)
    assert ForceStage(mechanism, 0.0, 2000.0, carry=True).currents_ma((1.0, 1.0, 1.0), middle, 1.0) == (0, 0, 0)
