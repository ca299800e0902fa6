"""The scripted operator and the minimum-jerk legs that it follows."""

from itertools import pairwise
from math import hypot
from typing import Any

import pytest

from weberlink.geometry.vector import Vector, distance
from weberlink.master.devices.motion import CircularLeg, LegSequence, StraightLeg
from weberlink.master.devices.operator import OperatorDevice, OperatorOptions

A: Vector = (0.0, 0.0, 0.03)
B: Vector = (0.02, -0.01, 0.0)
C: Vector = (0.025, 0.0, 0.0)


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


TICK = 0.001


def run(seconds: float, **options: Any) -> list[tuple[Vector, bool]]:
    device = OperatorDevice(OperatorOptions(tremor_m=0.0, **options), TICK)
    device.open(0.0)
    readings = [device.latest(tick * TICK) for tick in range(1, round(seconds / TICK) + 1)]
    return [(reading.position, reading.ended) for reading in readings]


def test_reach_arrives_and_ends() -> None:
    steps = run(3.0, script=[{"motion": "reach", "to_m": [0.03, 0.01, 0.0], "duration_s": 1.0}], repeat=False)
    assert steps[-1][0] == pytest.approx((0.03, 0.01, 0.0), abs=1e-5)
    assert [ended for _, ended in steps].index(True) in (999, 1000)
    assert steps[-1][1]


def test_a_repeated_script_goes_on() -> None:
    script = [{"motion": "reach", "to_m": [0.03, 0.0, 0.0], "duration_s": 0.5}, {"motion": "rest", "duration_s": 0.5}]
    steps = run(6.0, script=script)
    assert not any(ended for _, ended in steps)
    assert [distance(steps[i][0], (0.03, 0.0, 0.0)) < 1e-3 for i in (950, 2950, 4950)] == [True] * 3
    assert distance(steps[2050][0], (0.0, 0.0, 0.03)) < 2e-3, "back home in between"


def test_a_tap_touches_as_often_as_asked() -> None:
    steps = run(4.0, script=[{"motion": "tap", "at_m": [0, 0, 0], "frequency_hz": 2, "count": 5}], repeat=False)
    heights = [position[2] for position, _ in steps]
    assert sum(a >= 0.0 > b for a, b in pairwise(heights)) == 5


def test_a_press_holds_its_depth() -> None:
    script = [{"motion": "press", "at_m": [0.01, 0, 0], "depth_m": 0.02, "hold_s": 1.0}]
    steps = run(2.3, script=script, repeat=False)
    assert steps[-1][0] == pytest.approx((0.01, 0.0, -0.02), abs=2e-4)


def test_a_slide_passes_its_points_back_and_forth() -> None:
    script = [
        {"motion": "slide", "points_m": [[-0.02, 0, 0], [0.02, 0, 0]], "depth_m": 0.01, "duration_s": 1, "passes": 3}
    ]
    steps = run(4.3, script=script, repeat=False)
    sliding = [position for position, _ in steps[1100:3800]]
    assert all(position[2] == pytest.approx(-0.01, abs=1e-3) for position in sliding)
    assert sum((a[0] < 0.0) != (b[0] < 0.0) for a, b in pairwise(sliding)) == 3
    assert steps[-1][0] == pytest.approx((0.02, 0.0, -0.01), abs=2e-4)


def test_a_circle_is_round() -> None:
    script = [{"motion": "circle", "center_m": [0.01, 0, 0], "radius_m": 0.02, "depth_m": 0.01, "duration_s": 8}]
    steps = run(8.8, script=script, repeat=False)
    for position, _ in steps[1400::100]:
        assert hypot(position[0] - 0.01, position[1]) == pytest.approx(0.02, abs=5e-4)
    assert {position[1] > 0.0 for position, _ in steps[1400:]} == {True, False}
