"""The measured limit beside that of the eigenvalues, at extremes."""

import pytest

from weberlink.studies.stability.boundary import disturbance_energy, grows, measured_limit
from weberlink.studies.stability.wall import Wall, stability_limit

WALLS = [
    Wall(0.001, 0.05, 0.01, 1 / 100),
    Wall(0.001, 50.0, 0.01, 1 / 4000),
    Wall(10.0, 0.5, 0.01, 1 / 1000),
    Wall(10.0, 50.0, 0.01, 1 / 4000),
    Wall(0.1, 5.0, 300.0, 1 / 1000, delay_ticks=1),
    Wall(0.001, 50.0, 0.01, 1 / 1000, delay_ticks=1),
    Wall(0.001, 0.5, 300.0, 1 / 100, delay_ticks=5),
    Wall(0.1, 5.0, 0.01, 1 / 1000, wall_damping_n_s_m=2.0),
    Wall(0.3, 8.0, 300.0, 1 / 1000, delay_ticks=1, wall_damping_n_s_m=2.0),
]


@pytest.mark.parametrize("wall", WALLS)
def test_measured_limit_is_that_of_the_eigenvalues(wall: Wall) -> None:
    assert measured_limit(wall) == pytest.approx(stability_limit(wall), rel=0.02)


@pytest.mark.parametrize("share", [0.05, 0.5, 0.95, 1.05, 2.0, 50.0])
def test_a_disturbance_dies_out_below_the_limit_and_grows_above(share: float) -> None:
    wall = Wall(0.3, 8.0, 300.0, 1e-3, delay_ticks=1)
    assert grows(wall, share * stability_limit(wall)) is (share > 1.0)


def test_a_run_ends_when_contact_is_nearly_lost() -> None:
    wall = Wall(0.3, 8.0, 300.0, 1e-3)
    energy = disturbance_energy(wall, 3.0 * stability_limit(wall), 100_000)
    assert len(energy) < 1000
    assert energy[-1] > 1e4 * energy[0]
