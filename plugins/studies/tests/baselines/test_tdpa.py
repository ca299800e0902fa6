"""Time-domain passivity as a guest: its contract, its passivity on a delayed wall, and its run by name."""

import pytest

from plugins.studies.tests.baselines.teleoperation import Course, operate
from weberlink.control.contract import AccountParameters, SchemeParameters
from weberlink.control.table import build_master_control, build_slave_control
from weberlink_studies.baselines.tdpa import MOST_DAMPING, TdpaMaster, TdpaSlave

SETTINGS = SchemeParameters(1e-3, 2500.0, AccountParameters(0.02, 0.01, 1.0, 0.1))


def test_a_damper_dissipates_what_was_not_paid_for() -> None:
    """A force of 2 N pulls the hand at 0.1 m/s for a tick: 0.2 mJ out, which one more tick at this speed takes back."""
    master = TdpaMaster(SETTINGS)
    master.observe((0.0, 0.0, 0.0), 1e-3, 0.0, 0, None)
    master.displayed((0.0, 0.0, 2.0))
    master.observe((0.0, 0.0, 1e-4), 1e-3, 1.0, 0, None)
    assert master.energy == pytest.approx(-2e-4)
    assert master.render((0.0, 0.0, 0.0)) == pytest.approx((0.0, 0.0, -2.0))
    master.observe((0.0, 0.0, 1.1e-4), 1e-3, 2.0, 0, None)  # slowly: more would be needed than there is
    assert master.render((0.0, 0.0, 0.0)) == pytest.approx((0.0, 0.0, -MOST_DAMPING * 0.01))


def generated(course: Course) -> float:
    """The most energy that came out of hand and wall beyond what went in [J]; the robot steps, so by trapezoids."""
    taken = least = 0.0
    for tick in range(1, len(course.robot)):
        mean = 0.5 * (course.wall_forces[tick] + course.wall_forces[tick - 1])
        taken -= mean * (course.robot[tick] - course.robot[tick - 1])
        least = min(least, course.given[tick + 1] - taken)
    return -least


@pytest.mark.parametrize("delay", [0.01, 0.05])
def test_it_is_passive_on_a_delayed_wall_where_none_is_not(delay: float) -> None:
    """Both ports together, on a spring of 500 N/m."""
    courses = [
        operate(master, slave, wall=500.0, delay=delay, seconds=4.0)
        for master, slave in (
            (TdpaMaster(SETTINGS), TdpaSlave(SETTINGS)),
            (build_master_control("none", SETTINGS), build_slave_control("none", SETTINGS)),
        )
    ]
    assert generated(courses[0]) < 0.03
    assert generated(courses[1]) > 0.5
    assert max(courses[0].wall_forces) > 1.0
