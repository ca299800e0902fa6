from itertools import pairwise
from random import Random

import pytest

from weberlink.geometry.vector import distance
from weberlink.studies.evaluate.exploration import Ground, exploration, home
from weberlink.studies.evaluate.scenes import ball, level

GROUND = Ground(level(0.0), 0.04, 0.005, (0.7, 4.5))
ROUND = Ground(ball((0.0, 0.0, -0.05), 0.05), 0.04, 0.005, (0.7, 4.5))
SAMPLES = 40


@pytest.mark.parametrize("ground", [GROUND, ROUND])
@pytest.mark.parametrize("seed", range(5))
def test_each_leg_begins_where_the_last_one_ended(ground: Ground, seed: int) -> None:
    legs = exploration(ground, 20.0, Random(seed))
    assert sum(leg.duration for leg in legs) > 20.0
    assert distance(legs[0].at(0.0), home(ground)) == 0.0
    for one, other in pairwise(legs):
        assert one.at(1.0) == pytest.approx(other.at(0.0), abs=1e-12)


@pytest.mark.parametrize("seed", range(5))
def test_it_moves_as_a_hand_does(seed: int) -> None:
    """Within reach, no deeper than the firmest touch, and no faster than half a metre a second."""
    touched = 0
    for leg in exploration(GROUND, 60.0, Random(seed)):
        places = [leg.at(i / SAMPLES) for i in range(SAMPLES + 1)]
        for x, y, z in places:
            assert max(abs(x), abs(y)) < 0.055
            assert -0.005 * 4.5 <= z <= 0.0201
            touched += z < 0.0
        for one, other in pairwise(places):
            assert distance(one, other) * SAMPLES / leg.duration < 0.5
    assert touched > 1000
