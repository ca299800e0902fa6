"""The model that the operator feels: kept if a sample agrees with it, dropped if a sample contradicts it."""

import pytest

from tests.control.vectors import largest_step
from tests.control.walls import Wall
from weberlink.control.contract import LinkQuality, SchemeParameters
from weberlink.control.mmt import MmtMaster
from weberlink.geometry.vector import ZERO, Vector

TICK = 1e-3
WALL = Wall(500.0)
DEPTH = 0.005
INSIDE = (0.0, 0.0, -DEPTH)
PRESSED = (0.0, 0.0, 500.0 * DEPTH)
QUALITY = LinkQuality(0.7, 0.0)


class Operator:
    """A hand on a prescribed path, and the forces that it felt."""

    def __init__(self) -> None:
        self.control = MmtMaster(SchemeParameters(TICK, 30.0, 0.05, 5.0, 0.25, 2500.0))
        self.at = 0.002
        self.forces: list[Vector] = []

    def go(self, height: float, ticks: int) -> Vector:
        """Move to a height [m] at constant speed; returns the last force."""
        start = self.at
        for tick in range(1, ticks + 1):
            self.at = start + (height - start) * tick / ticks
            self.control.observe((0.0, 0.0, self.at), TICK, 0.0, 0, QUALITY)
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
        ((0.0, 0.0, 1.0), (0.0, 0.0, 0.01)),
        ((2.5, 0.0, 0.0), INSIDE),
    ],
    ids=["the wall is gone", "softer", "another wall in front", "another direction"],
)
def test_a_sample_that_contradicts_drops_the_model_and_is_held(force: Vector, position: Vector) -> None:
    operator = Operator.pressing()
    operator.control.learn(None, force, position)
    assert operator.go(-DEPTH, 3000) == pytest.approx(force, abs=0.02)
    assert operator.go(-0.5 * DEPTH, 1) != PRESSED


def test_no_change_of_the_model_jumps() -> None:
    """A step is at most that of one tick of the change."""
    operator = Operator.pressing()
    for force in (ZERO, (0.0, 0.0, 5.0), (3.0, 0.0, 0.0), PRESSED):
        before = len(operator.forces) - 1
        operator.control.learn(WALL if force is PRESSED else None, force, INSIDE)
        operator.go(-DEPTH, 1000)
        assert largest_step(operator.forces[before:]) <= 10.0 * TICK / 0.05


def test_reset_forgets_the_model() -> None:
    operator = Operator.pressing()
    operator.control.reset()
    assert operator.go(-DEPTH, 100) == ZERO
    assert operator.control.tank == 0.0
