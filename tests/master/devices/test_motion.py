from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from weberlink.geometry.vector import Vector, distance
from weberlink.master.devices.motion import CircularLeg, LegSequence, StraightLeg, minimum_jerk

A: Vector = (0.0, 0.0, 0.03)
B: Vector = (0.02, -0.01, 0.0)
C: Vector = (0.025, 0.0, 0.0)


def test_minimum_jerk_starts_and_ends_at_rest() -> None:
    assert (minimum_jerk(0.0), minimum_jerk(0.5), minimum_jerk(1.0)) == (0.0, 0.5, 1.0)
    for share in (0.0, 1.0 - 1e-4):
        assert abs(minimum_jerk(share + 1e-4) - minimum_jerk(share)) < 1e-7


@given(share=st.floats(0.0, 1.0))
def test_minimum_jerk_is_symmetric(share: float) -> None:
    assert minimum_jerk(share) + minimum_jerk(1.0 - share) == pytest.approx(1.0)


def test_legs_follow_one_another_without_a_jump() -> None:
    motion = LegSequence(
        [
            StraightLeg(A, B, 0.5),
            StraightLeg(B, B, 0.2),
            StraightLeg(B, C, 0.3),
            CircularLeg((0.0, 0.0, 0.0), 0.025, 1.5, 1.0),
        ],
        False,
    )
    assert motion.duration == pytest.approx(2.0)
    assert motion.at(0.0) == (A, False)
    assert motion.at(0.6)[0] == B
    assert motion.at(2.0)[1]
    assert motion.at(99.0)[0] == pytest.approx((-0.025, 0.0, 0.0))
    places = [motion.at(0.001 * i)[0] for i in range(2001)]
    assert max(distance(a, b) for a, b in pairwise(places)) < 0.0006


def test_a_repeated_motion_never_ends() -> None:
    motion = LegSequence([StraightLeg(A, B, 0.5), StraightLeg(B, A, 0.5)], True)
    place, over = motion.at(7.25)
    assert not over
    assert place == pytest.approx(motion.at(0.25)[0])


def test_a_motion_takes_time() -> None:
    with pytest.raises(ValueError, match="at least one leg"):
        LegSequence([StraightLeg(A, B, 0.0)], False)
