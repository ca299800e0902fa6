"""A contact that the operator feels by a model, and that the robot does not reach: the robot's end takes it back."""

from collections.abc import Callable

import pytest

from weberlink.codec import Decoder, Encoder, force_channel
from weberlink.control.contract import UNREACHED_S
from weberlink.geometry.vector import ZERO, Vector, norm
from weberlink.slave.robot_port import Unreached

TICK, STIFFNESS, FLOOR = 1e-3, 500.0, 0.02
MOST = round(UNREACHED_S / TICK)
DEPTH = 0.01
INSIDE, OUTSIDE = (0.0, 0.0, -DEPTH), (0.0, 0.0, 0.005)


class Robot:
    """What a robot feels, where, and where it is led to; and what the operator's end decodes."""

    def __init__(self, predictor: str = "plane") -> None:
        channel = force_channel(predictor=predictor, floor=FLOOR)
        self.encoder, self.decoder = Encoder(channel), Decoder(channel)
        self.is_led_to: Vector | None = OUTSIDE
        self.follows = True
        self.unreached = Unreached(self.encoder.mirror, self, 0, 0.05, TICK)
        self.tick = 0
        self.updates = 0

    def led(self, _channel: int) -> Vector | None:
        return self.is_led_to

    def go(self, place: Vector, led: Vector | None, ticks: int) -> Vector | None:
        """Be there, led to another place, on a plane at z = 0; returns what the operator's end decodes there."""
        for _ in range(ticks):
            self.tick += 1
            self.is_led_to, force = led, (0.0, 0.0, max(0.0, -STIFFNESS * place[2]))
            update = self.encoder.encode(self.tick, force, self.unreached.place(self.tick, force, place))
            if update is not None:
                self.updates += 1
                self.decoder.apply(update)
        return self.decoder.value(self.tick, ZERO if led is None else led)

    def pressed(self) -> "Robot":
        """After a contact from which both ends have learned the plane, in free motion."""
        for step in range(1, 11):
            where = (0.0, 0.0, -0.1 * step * DEPTH)
            self.go(where, where, 20)
        self.go(OUTSIDE, OUTSIDE, 100)
        self.updates = 0
        return self


@pytest.mark.parametrize("predictor", ["plane", "hybrid"])
def test_a_robot_that_is_held_back_takes_the_contact_back_in_time(predictor: str) -> None:
    check_that_it_takes_the_contact_back(predictor)


def check_that_it_takes_the_contact_back(predictor: str) -> None:
    robot = Robot(predictor).pressed()
    felt = robot.go(OUTSIDE, INSIDE, MOST)
    assert felt is not None
    assert norm(felt) == pytest.approx(STIFFNESS * DEPTH, rel=0.1)
    felt = robot.go(OUTSIDE, INSIDE, 2)
    assert felt is not None
    assert norm(felt) <= FLOOR
    assert robot.updates == 1
    robot.go(OUTSIDE, INSIDE, 500)
    assert robot.updates == 1


def test_a_robot_that_does_not_follow_at_all_takes_it_back_at_once() -> None:
    robot = Robot().pressed()
    robot.follows = False
    assert robot.go(OUTSIDE, INSIDE, 1) == ZERO


NEVER: dict[str, Callable[[Robot], object]] = {
    "follows": lambda robot: robot.go(INSIDE, INSIDE, 500),
    "is led above the surface": lambda robot: robot.go((0.0, 0.0, 0.02), OUTSIDE, 500),
    "lags behind a quick hand": lambda robot: [
        (robot.go(OUTSIDE, INSIDE, MOST // 2), robot.go(INSIDE, INSIDE, 10), robot.go(OUTSIDE, OUTSIDE, 30))
        for _ in range(10)
    ],
    "is not led": lambda robot: robot.go(OUTSIDE, None, 500),
}


@pytest.mark.parametrize("course", NEVER)
def test_it_says_nothing_of_a_robot_that(course: str) -> None:
    robot = Robot().pressed()
    NEVER[course](robot)
    assert robot.updates == 0


def test_where_it_touches_again_the_contact_is_there_again() -> None:
    robot = Robot().pressed()
    robot.go(OUTSIDE, INSIDE, 100)
    felt = robot.go(INSIDE, INSIDE, 1)
    assert felt is not None
    assert norm(felt) == pytest.approx(STIFFNESS * DEPTH, rel=0.1)
