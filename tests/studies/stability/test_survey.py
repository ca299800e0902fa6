"""What is said of a wall, and which walls are looked at."""

import json

from weberlink.studies.stability.survey import survey, walls
from weberlink.studies.stability.wall import Wall


def test_a_row_says_what_was_found() -> None:
    row = survey(Wall(0.1, 5.0, 0.01, 1e-3))
    assert abs(row.deviation) < 0.02
    assert row.passive_but_active == 0
    assert {energy > 0.0 for stiffness, energy in row.activities if stiffness > row.passive_to_n_m} == {True}
    document = json.loads(json.dumps(row.as_json(), allow_nan=False))
    assert document["mass_kg"] == 0.1
    assert len(document["cells"]) == len(row.activities)


def test_a_wall_that_is_passive_at_no_stiffness_has_no_cells() -> None:
    row = survey(Wall(0.1, 5.0, 0.01, 1e-3, wall_damping_n_s_m=6.0))
    assert row.passive_to_n_m == 0.0
    assert row.activities == ()


def test_walls_span_decades() -> None:
    for full in (False, True):
        limits = [wall.damping_n_s_m / wall.tick_period for wall in walls(full=full)]
        assert max(limits) / min(limits) > 1e3
        assert len(set(walls(full=full))) == len(walls(full=full))
    assert len(walls(full=True)) > 5 * len(walls(full=False))
