"""The model that the operator feels: kept if a sample agrees with it, dropped if a sample contradicts it."""

from math import cos, sin

import pytest

from tests.control.teleoperation import Quality
from tests.control.vectors import largest_step
from tests.control.walls import Wall
from weberlink.codec.predictors.surface import SurfacePatch
from weberlink.control.contract import FREE_FORCE, SchemeParameters
from weberlink.control.extent import LEAST_EXTENT, MOST_EDGES, KnownSurface
from weberlink.control.mmt import FARTHEST, LONGEST_DRIFT, MmtMaster
from weberlink.geometry.vector import ZERO, Vector, distance, norm

TICK = 1e-3
WALL = Wall(500.0)
DEPTH = 0.005
INSIDE = (0.0, 0.0, -DEPTH)
PRESSED = (0.0, 0.0, 500.0 * DEPTH)
QUALITY = Quality(0.7, 0.0)


class Operator:
    """A hand on a prescribed path, and the forces that it felt."""

    def __init__(self) -> None:
        self.control = MmtMaster(SchemeParameters(TICK, 30.0, 0.05, 5.0, 0.25, 2500.0))
        self.at = 0.002
        self.aside = 0.0
        self.forces: list[Vector] = []

    def go(self, height: float, ticks: int, aside: float | None = None) -> Vector:
        """Move to a height and along x [m] at constant speed; returns the last force."""
        start, left = self.at, self.aside
        right = left if aside is None else aside
        for tick in range(1, ticks + 1):
            self.at = start + (height - start) * tick / ticks
            self.aside = left + (right - left) * tick / ticks
            self.control.observe((self.aside, 0.0, self.at), TICK, 0.0, 0, QUALITY)
            force = self.control.render((9.0, 9.0, 9.0))
            self.control.displayed(force)
            self.forces.append(force)
        return self.forces[-1]

    @classmethod
    def pressing(cls) -> "Operator":
        """An operator who received the model of the wall in free space, and presses on it now."""
        operator = cls()
        operator.control.learn(WALL, PRESSED, INSIDE)
        operator.go(0.002, 300)
        operator.go(-DEPTH, 100)
        operator.go(-DEPTH, 500)
        return operator


def test_a_model_that_came_in_free_space_is_felt_at_once_and_whole() -> None:
    operator = Operator()
    operator.control.learn(WALL, PRESSED, INSIDE)
    operator.go(0.002, 300)
    for depth in (0.001, 0.002, DEPTH):
        operator.go(-depth, 50)
        felt = operator.go(-depth, 2)  # at rest, without drag
        assert felt[2] == pytest.approx(500.0 * depth, rel=0.1)
        assert felt[:2] == (0.0, 0.0)


def test_it_is_the_model_that_is_felt_and_not_what_was_decoded() -> None:
    assert Operator().go(-DEPTH, 100) == pytest.approx(ZERO, abs=1.0)  # drag, of a hand that moves


@pytest.mark.parametrize(
    ("force", "position"),
    [
        (ZERO, (0.0, 0.0, 0.01)),
        ((0.0, 0.0, 2.3), INSIDE),
        ((0.0, 0.2, 2.6), INSIDE),
        ((0.0, 0.0, 0.04), (0.0, 0.0, 0.0001)),
    ],
    ids=["free space in front of it", "less, but nearly", "aslant, but nearly", "noise"],
)
def test_a_sample_that_agrees_keeps_the_model(force: Vector, position: Vector) -> None:
    operator = Operator.pressing()
    operator.control.learn(None, force, position)
    assert operator.go(-DEPTH, 500) == pytest.approx(PRESSED, abs=1e-6)


@pytest.mark.parametrize(
    ("force", "position"),
    [
        (ZERO, INSIDE),
        ((0.0, 0.0, 1.0), INSIDE),
        ((2.5, 0.0, 0.0), INSIDE),
    ],
    ids=["the wall is gone", "softer", "another direction"],
)
def test_a_sample_that_contradicts_replaces_the_model(force: Vector, position: Vector) -> None:
    operator = Operator.pressing()
    operator.control.learn(None, force, position)
    assert operator.go(-DEPTH, 3000) == pytest.approx(force, abs=0.02)
    assert operator.go(-0.5 * DEPTH, 1) != PRESSED


def test_a_sample_without_a_surface_is_a_wall_as_stiff_as_the_coupling() -> None:
    operator = Operator()
    operator.go(0.001, 300)
    operator.control.learn(None, (0.0, 0.0, 1.0), (0.0, 0.0, 0.0))
    for height, force in ((0.0, 1.0), (-0.0002, 1.5), (0.0002, 0.5), (0.0005, 0.0)):
        operator.go(height, 50)
        assert operator.go(height, 2000) == pytest.approx((0.0, 0.0, force), abs=0.02)


def test_the_command_lies_where_the_model_states_the_displayed_force() -> None:
    operator = Operator()
    operator.go(-DEPTH, 300)
    operator.control.learn(WALL, PRESSED, INSIDE)
    for _ in range(400):
        shown = operator.go(-DEPTH, 1)
        operator.control.observe((0.0, 0.0, -DEPTH), TICK, 0.0, 0, QUALITY)
        assert WALL.at(0.0, operator.control.command((0.0, 0.0, -DEPTH))) == pytest.approx(shown, abs=1e-9)
    assert 0.2 * PRESSED[2] < shown[2] < PRESSED[2]  # as far as the drag on the way has paid for it


def test_a_fit_that_is_much_too_soft_does_not_send_the_robot_away() -> None:
    operator = Operator()
    operator.go(-DEPTH, 300)
    operator.control.learn(Wall(20.0, 0.2), (0.0, 0.0, 4.0), INSIDE)
    operator.go(-DEPTH, 1)
    assert distance(operator.control.command(INSIDE), INSIDE) == pytest.approx(FARTHEST)


def test_no_change_of_the_model_jumps() -> None:
    """A step is at most that of one tick of the change."""
    operator = Operator.pressing()
    for force in (ZERO, (0.0, 0.0, 5.0), (3.0, 0.0, 0.0), PRESSED):
        before = len(operator.forces) - 1
        operator.control.learn(WALL if force is PRESSED else None, force, INSIDE)
        operator.go(-DEPTH, 1000)
        assert largest_step(operator.forces[before:]) <= 10.0 * TICK / 0.05


EDGE = 0.02


def beyond_the_edge() -> Operator:
    """An operator who slid off a wall that ends at `EDGE`, and learned it there."""
    operator = Operator.pressing()
    assert operator.go(-DEPTH, 500, aside=EDGE + 0.01)[2] == pytest.approx(PRESSED[2], abs=0.05)
    operator.control.learn(None, ZERO, (EDGE, 0.0, -DEPTH))
    assert operator.go(-DEPTH, 200) == pytest.approx(ZERO, abs=1e-6)
    return operator


def test_a_wall_that_ended_is_felt_at_once_where_it_is() -> None:
    operator = beyond_the_edge()
    operator.go(0.002, 200)
    operator.go(0.002, 200, aside=EDGE - 0.003)
    for depth in (0.001, DEPTH):
        operator.go(-depth, 50)
        assert operator.go(-depth, 2)[2] == pytest.approx(500.0 * depth, rel=0.1)


def test_a_hand_that_comes_back_below_a_wall_that_ended_is_pushed_as_far_as_it_has_paid() -> None:
    operator = beyond_the_edge()
    before = len(operator.forces)
    tank = operator.control.tank
    operator.go(-DEPTH, 1, aside=EDGE - 0.001)
    operator.go(-DEPTH, 3000)
    assert largest_step(operator.forces[before + 2 :]) <= 10.0 * TICK / 0.05
    assert operator.control.tank == pytest.approx(tank, abs=1e-3)  # nobody moved, so nothing was paid out


def test_a_sample_beyond_an_edge_that_agrees_with_the_wall_moves_the_edge() -> None:
    operator = beyond_the_edge()
    operator.control.learn(None, PRESSED, (EDGE + 0.02, 0.0, -DEPTH))
    assert operator.go(-DEPTH, 3000) == pytest.approx(PRESSED, abs=1e-6)


def test_no_more_edges_than_allowed_and_the_newest_stay() -> None:
    known = KnownSurface(WALL, ZERO)
    normal = (0.0, 0.0, 1.0)
    for number in range(MOST_EDGES + 3):
        angle = 0.4 * number
        assert known.end((0.01 * cos(angle), 0.01 * sin(angle), -DEPTH), normal)
    assert not known.has((0.011 * cos(angle), 0.011 * sin(angle), 0.0))
    assert known.has((0.009 * cos(angle), 0.009 * sin(angle), 0.0))
    known = KnownSurface(WALL, ZERO)
    assert not known.end((0.5 * LEAST_EXTENT, 0.0, -DEPTH), normal)  # it is gone


@pytest.mark.parametrize("sample", [ZERO, None], ids=["free before", "in contact"])
def test_a_wall_that_the_robot_does_not_find_is_lost_after_a_round_trip(sample: Vector | None) -> None:
    """After a sample without force the sender is silent until it finds the wall; after a model, while it is right."""
    operator = Operator.pressing()
    operator.go(0.002, 100)
    if sample is not None:
        operator.control.learn(None, sample, (0.0, 0.0, 0.002))
    operator.go(0.002, 5000)  # the measured delay has settled
    operator.go(-DEPTH, 10)
    felt = operator.go(-DEPTH, 600)
    assert felt == pytest.approx(PRESSED, abs=1e-6)
    assert operator.go(-DEPTH, 400) == pytest.approx(PRESSED if sample is None else ZERO, abs=1e-6)


def test_an_update_in_the_middle_of_a_change_does_not_begin_it_anew() -> None:
    operator = Operator()
    operator.control.learn(WALL, PRESSED, INSIDE)
    for number in range(10):
        operator.go(0.002, 10)
        operator.control.learn(Wall(500.0, 1e-5 * number), PRESSED, INSIDE)
    operator.go(-DEPTH, 50)
    assert operator.go(-DEPTH, 2)[2] == pytest.approx(PRESSED[2], rel=0.1)


def test_a_surface_is_not_extrapolated_without_bound() -> None:
    """A motion that is fitted wrongly would carry it out of the workspace."""
    speed, control = 1e-4, Operator().control
    control.observe(INSIDE, TICK, 0.0, 0, Quality(0.0, 0.0))
    control.learn(SurfacePatch((0.0, 0.0, 1.0), ZERO, 0, 500.0, velocity=-speed), ZERO, ZERO)
    for tick in range(1, 1200):
        control.observe(INSIDE, TICK, tick, 0, Quality(0.0, 0.0))
        assert control.stiffness == (500.0 if tick * speed <= LONGEST_DRIFT else 2500.0)


SPEED = 5e-5
"""Of a surface that rises against the hand [m/tick]."""


def carried(ticks: int) -> tuple[MmtMaster, float]:
    """A hand that a surface lifts, by the model that an update has brought; and the energy in the tank before."""
    control, quality = MmtMaster(SchemeParameters(TICK, 30.0, 0.05, 5.0, 0.25, 2500.0)), Quality(0.0, 0.0)

    def hold(at: Vector, tick: float) -> None:
        control.observe(at, TICK, tick, 0, quality)
        control.displayed(control.render(PRESSED))

    for step in range(1, 1000):  # the hand presses in and pays for what the model stores
        hold((0.0, 0.0, 0.002 - (0.002 + DEPTH) * min(1.0, step / 300)), 0.0)
        if step == 1:
            control.learn(SurfacePatch((0.0, 0.0, 1.0), ZERO, 0, 500.0, velocity=SPEED), PRESSED, INSIDE)
    before = control.tank
    for tick in range(1, ticks + 1):
        hold(INSIDE, tick)
    return control, before


def test_a_modelled_motion_gives_no_energy_by_itself() -> None:
    control, before = carried(100)
    assert control.tank == pytest.approx(before, abs=1e-5)


def test_a_motion_that_a_sample_confirms_has_given_its_energy() -> None:
    control, before = carried(100)
    risen = 100 * SPEED
    force = (0.0, 0.0, PRESSED[2] + 500.0 * risen)
    control.learn(SurfacePatch((0.0, 0.0, 1.0), (0.0, 0.0, risen), 100, 500.0), force, INSIDE)
    most = (PRESSED[2] + 0.5 * 500.0 * risen) * risen
    assert before + 0.3 * most <= control.tank <= before + most


def test_a_surface_that_is_found_farther_back_takes_back_what_it_gave() -> None:
    """Damping is taken for motion: it lifts the wall while the hand presses in, and is gone when the hand rests."""
    control, before = carried(100)
    risen = 100 * SPEED
    force = (0.0, 0.0, PRESSED[2] + 500.0 * risen)
    control.learn(SurfacePatch((0.0, 0.0, 1.0), (0.0, 0.0, risen), 100, 500.0), force, INSIDE)
    assert control.tank > before + 5e-3
    control.learn(WALL, PRESSED, INSIDE)
    assert control.tank == pytest.approx(before, abs=1e-5)


@pytest.mark.parametrize("force", [PRESSED, ZERO], ids=["it did not move", "it is not there"])
def test_a_motion_that_a_sample_refutes_has_given_none(force: Vector) -> None:
    control, before = carried(100)
    control.learn(WALL if force is PRESSED else None, force, INSIDE)
    assert control.tank == pytest.approx(before, abs=1e-5)


def test_a_surface_that_is_refuted_is_gone() -> None:
    operator = Operator.pressing()
    operator.control.refute()
    assert operator.go(-DEPTH, 60) == pytest.approx(ZERO, abs=1e-6)
    operator.go(0.002, 100)
    assert norm(operator.go(-DEPTH, 100)) <= FREE_FORCE  # drag


def test_reset_forgets_the_model() -> None:
    operator = Operator.pressing()
    operator.control.reset()
    assert operator.go(-DEPTH, 100) == ZERO
    assert operator.control.tank == 0.0
