from math import inf, nan

import pytest

from weberlink.codec.deadband import ForceDeadband, PositionDeadband
from weberlink.geometry.vector import ZERO

F3, F4, F5 = (0.0, 0.0, 3.0), (0.0, 4.0, 0.0), (5.0, 0.0, 0.0)


@pytest.mark.parametrize(("reference", "expected"), [("actual", 0.3), ("displayed", 0.4), ("sent", 0.5)])
def test_weber_bound_scales_with_the_chosen_reference(reference: str, expected: float) -> None:
    deadband = ForceDeadband(0.1, 0.02, reference)  # type: ignore[arg-type]
    assert deadband.bound(F3, F4, F5, 0.0) == pytest.approx(expected)


def test_the_floor_is_the_least_bound() -> None:
    assert ForceDeadband(0.1, 0.02).bound(ZERO, F4, F5, 0.0) == 0.02
    assert ForceDeadband(0.1).bound(ZERO, F4, F5, 0.0) == 0.0


def test_position_bound_grows_with_the_way_moved_in_a_tick() -> None:
    deadband = PositionDeadband(0.1, 2e-4)
    assert deadband.bound((0.01, 0.0, 0.0), ZERO, ZERO, 0.0) == 2e-4
    assert deadband.bound((0.01, 0.0, 0.0), ZERO, ZERO, 0.01) == pytest.approx(2e-4 + 0.1 * 0.01)


@pytest.mark.parametrize("bad", [-0.1, nan, inf])
def test_refuses_bounds_that_are_none(bad: float) -> None:
    with pytest.raises(ValueError, match="weber"):
        ForceDeadband(bad)
    with pytest.raises(ValueError, match="floor"):
        ForceDeadband(0.1, bad)
    with pytest.raises(ValueError, match="bound"):
        PositionDeadband(0.1, bad)


def test_refuses_an_unknown_reference() -> None:
    with pytest.raises(ValueError, match="displayed"):
        ForceDeadband(0.1, 0.0, "wanted")  # type: ignore[arg-type]
