"""Who gets energy out of a sampled wall, and on which side of Colgate's bound."""

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from tests.examples import examples
from weberlink.studies.stability.activity import activity, bounce, generated, motions
from weberlink.studies.stability.wall import Wall, passivity_limit

FREE = 0.01


@given(
    damping=st.floats(0.05, 50.0),
    mass=st.floats(0.001, 10.0),
    period=st.sampled_from([1 / 100, 1 / 1000, 1 / 4000]),
    delay=st.integers(0, 4),
    wall_share=st.floats(0.0, 0.9),
    share=st.floats(0.01, 1.0),
)
@examples(40)
def test_no_motion_gets_energy_out_of_a_wall_on_the_passive_side(
    damping: float, mass: float, period: float, delay: int, wall_share: float, share: float
) -> None:
    wall = Wall(mass, damping, FREE, period, delay, wall_share * damping)
    passive = passivity_limit(wall)
    assume(passive > 0.0)
    assert activity(wall, share * passive) <= 1e-9


@pytest.mark.parametrize(("delay", "wall_damping"), [(0, 0.0), (1, 0.0), (4, 0.0), (0, 2.0)])
def test_some_motion_does_just_beyond_the_bound(delay: int, wall_damping: float) -> None:
    wall = Wall(0.3, 8.0, FREE, 1e-3, delay, wall_damping)
    assert activity(wall, 1.03 * passivity_limit(wall)) > 0.0


@given(path_um=st.lists(st.integers(-2000, 1000), min_size=2, max_size=12, unique=True), delay=st.integers(0, 3))
@examples(100)
def test_nor_does_any_path_that_nobody_thought_of(path_um: list[int], delay: int) -> None:
    wall = Wall(0.3, 8.0, FREE, 1e-3, delay)
    assert generated(wall, passivity_limit(wall), [1e-6 * height for height in path_um]) <= 1e-9


def test_motions_touch_the_wall_and_leave_it() -> None:
    heights = list(motions())
    assert all(len(set(path)) > 1 for path in heights)
    assert any(max(path) > 0.0 > min(path) for path in heights)
    assert any(max(path) < 0.0 for path in heights)


@pytest.mark.parametrize("delay", [0, 1])
def test_a_passive_wall_never_throws_a_device_back_harder_than_it_came_and_a_stiff_one_does(delay: int) -> None:
    wall = Wall(0.3, 5.0, FREE, 1e-3, delay)
    passive = passivity_limit(wall)
    for share in (0.1, 0.3, 0.5, 0.7, 0.9, 1.0):
        assert 0.0 < bounce(wall, share * passive) < 1.0
    assert bounce(wall, 2.0 * passive) > 1.0
