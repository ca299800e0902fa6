"""No current beyond a limit, whatever is asked in whatever pose."""

from math import isfinite, pi

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.examples import examples
from weberlink.geometry.vector import Vector, distance, norm
from weberlink.master.devices.polhem.force_stage import RAMP_S, ForceStage
from weberlink.master.devices.polhem.parameters import PARAMETERS

modest = examples(60)

components = st.floats(-1e6, 1e6)
vectors = st.tuples(components, components, components)
WOODY = PARAMETERS["woodenhaptics_2015"].mechanism
MIDDLE = WOODY.counts_at((0.0, 0.0, 0.0))


@modest
@given(st.sampled_from(sorted(PARAMETERS)), vectors, st.tuples(*[st.integers(-40_000, 40_000)] * 3))
def test_limits_hold_everywhere(name: str, force: Vector, counts: tuple[int, int, int]) -> None:
    stage = ForceStage(PARAMETERS[name].mechanism, 5.0, 1500.0)
    currents = stage.currents_ma(force, counts, 1.0)
    assert all(isfinite(current) and abs(current) <= 1500 for current in currents)


def test_a_force_within_the_limits_is_what_comes_out() -> None:
    stage = ForceStage(WOODY, 5.0, 6000.0)
    force = (0.5, -1.0, 2.0)
    assert distance(WOODY.force(stage.currents_ma(force, MIDDLE, 1.0), MIDDLE), force) < 5e-3


def test_too_much_is_cut_and_keeps_its_direction() -> None:
    force = (10.0, -20.0, 40.0)
    for stage, expected in ((ForceStage(WOODY, 2.0, 6000.0), 2.0), (ForceStage(WOODY, 100.0, 800.0), None)):
        felt = WOODY.force(stage.currents_ma(force, MIDDLE, 1.0), MIDDLE)
        assert distance(felt, tuple_of(force, norm(felt) / norm(force))) < 0.02
        if expected is not None:
            assert norm(felt) == pytest.approx(expected, abs=0.02)
        assert max(map(abs, stage.currents_ma(force, MIDDLE, 1.0))) <= 6000


def tuple_of(vector: Vector, factor: float) -> Vector:
    return (vector[0] * factor, vector[1] * factor, vector[2] * factor)


def test_it_comes_up_from_zero() -> None:
    stage = ForceStage(WOODY, 5.0, 6000.0)
    felt = [
        norm(WOODY.force(stage.currents_ma((0.0, 0.0, 5.0), MIDDLE, share * RAMP_S), MIDDLE))
        for share in (-1.0, 0.0, 0.25, 0.5, 1.0, 10.0)
    ]
    assert felt == pytest.approx([0.0, 0.0, 1.25, 2.5, 5.0, 5.0], abs=0.02)


def test_without_permission_there_is_no_current() -> None:
    stage = ForceStage(WOODY, 0.0, 2000.0)
    assert stage.currents_ma((5.0, 5.0, 5.0), MIDDLE, 1.0) == (0, 0, 0)


def test_at_the_dead_point_of_the_five_bar_currents_are_limited() -> None:
    """Forearm and coupler in line: no force of the tip turns the crank, and the Jacobian has no end."""
    mechanism = PARAMETERS["polhem_v3"].mechanism
    stage = ForceStage(mechanism, 5.0, 2000.0)
    for degree in range(360):
        counts = mechanism.drive.counts((0.0, 0.9, degree * pi / 180))
        assert max(map(abs, stage.currents_ma((5.0, 0.0, 0.0), counts, 1.0))) <= 2000
