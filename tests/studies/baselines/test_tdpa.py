"""Time-domain passivity as a guest: its contract, its passivity on a delayed wall, and its run by name."""

from math import isfinite
from random import Random

import pytest

from tests.control.teleoperation import Hand, Link, Quality, operate
from tests.control.walls import Wall
from weberlink.control.contract import AccountParameters, SchemeParameters
from weberlink.control.table import build_master_control, build_slave_control
from weberlink.studies.baselines.tdpa import MOST_DAMPING, TdpaMaster, TdpaSlave

SETTINGS = SchemeParameters(1e-3, 2500.0, AccountParameters(0.02, 0.01, 1.0, 0.1))


@pytest.mark.parametrize("seed", range(5))
def test_any_ticks_give_finite_outputs_and_growing_credit(seed: int) -> None:
    random = Random(seed)
    master, slave = TdpaMaster(SETTINGS), TdpaSlave(SETTINGS)
    here = (0.0, 0.0, 0.0)

    def some(size: float) -> tuple[float, float, float]:
        return (random.gauss(0.0, size), random.gauss(0.0, size), random.choice((0.0, random.gauss(0.0, size))))

    def told() -> tuple[int, int]:
        return master.credit, slave.credit

    for _ in range(200):
        elapsed, heard, before = random.choice((0.0, 1e-3, 0.3)), random.randrange(10**5), told()
        master.observe(some(0.05), elapsed, 0.0, heard, Quality(None, 0.0))
        force = master.render(some(20.0))
        master.displayed(force)
        goal = slave.follow(some(0.05), here, elapsed, heard, Quality(0.1, 0.0))
        here = random.choice((goal, here))
        slave.observe(here, some(20.0))
        assert all(map(isfinite, (*force, *goal, master.energy, slave.energy)))
        assert all(now >= was for now, was in zip(told(), before, strict=True))
        if random.random() < 0.05:
            master.resume(heard)
            slave.resume(heard)
            assert max(master.energy, slave.energy) <= 0.0
            assert all(now >= was for now, was in zip(told(), before, strict=True))


def test_a_damper_dissipates_what_was_not_paid_for() -> None:
    """A force of 2 N pulls the hand at 0.1 m/s for a tick: 0.2 mJ out, which one more tick at this speed takes back."""
    master = TdpaMaster(SETTINGS)
    master.observe((0.0, 0.0, 0.0), 1e-3, 0.0, 0, Quality(None, 0.0))
    master.displayed((0.0, 0.0, 2.0))
    master.observe((0.0, 0.0, 1e-4), 1e-3, 1.0, 0, Quality(None, 0.0))
    assert master.energy == pytest.approx(-2e-4)
    assert master.render((0.0, 0.0, 0.0)) == pytest.approx((0.0, 0.0, -2.0))
    master.observe((0.0, 0.0, 1.1e-4), 1e-3, 2.0, 0, Quality(None, 0.0))  # slowly: more would be needed than there is
    assert master.render((0.0, 0.0, 0.0)) == pytest.approx((0.0, 0.0, -MOST_DAMPING * 0.01))


@pytest.mark.parametrize("delay", [0.01, 0.05])
def test_it_is_passive_on_a_delayed_wall_where_none_is_not(delay: float) -> None:
    """Both ports together, on a spring of 500 N/m."""
    courses = [
        operate(master, slave, wall=Wall(500.0), link=Link(delay), hand=Hand(), seconds=4.0)
        for master, slave in (
            (TdpaMaster(SETTINGS), TdpaSlave(SETTINGS)),
            (build_master_control("none", SETTINGS), build_slave_control("none", SETTINGS)),
        )
    ]
    ours, none = (course.generated_between_the_ports for course in courses)
    assert ours < 0.03
    assert none > 0.5
    assert max(courses[0].wall_forces) > 1.0
