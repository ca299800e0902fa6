"""A hand taps on a surface and presses on it: what the press limit makes of it, beside a robot that has no limit."""

from collections.abc import Callable
from dataclasses import dataclass
from math import ceil, inf
from typing import Any

import pytest
from hypothesis import example, given, strategies as st

from tests.examples import examples, tenfold
from tests.slave.scenes.solids import wall
from weberlink.control.contract import LEAST_CONTACT
from weberlink.slave.guard import Guard, PressLimit, PressStep, axis_press_limit
from weberlink.slave.robots.computed import PointRobot
from weberlink.slave.robots.contract import Robot, RobotReading
from weberlink.slave.robots.simulated import SimulatedOptions, SimulatedRobot
from weberlink.slave.robots.virtual import PointOptions

SPEED = 2.0  # Largest speed of a command [m/s]
HEIGHT = 0.005  # From which a tap begins [m]


@dataclass(frozen=True)
class Tap:
    """A motion down to a depth, a rest there, and the way back, as often as there are taps."""

    speed: float  # largest one [m/s]
    depth: float = 0.02  # below the surface [m]
    rest: float = 0.1  # how long it stays down [s]
    taps: int = 2
    hold: int = 1  # ticks for which a command is held, as a coarse coding does

    @property
    def way_time(self) -> float:
        return 1.875 * (HEIGHT + self.depth) / self.speed

    @property
    def period(self) -> float:
        return 2.0 * self.way_time + self.rest

    def at(self, time: float) -> float:
        """Height of the hand above the surface [m]: minimum jerk down and up."""
        phase = time % self.period
        share = min(1.0, phase / self.way_time, max(0.0, (self.period - phase) / self.way_time))
        return HEIGHT - (HEIGHT + self.depth) * share**3 * (10.0 - 15.0 * share + 6.0 * share * share)


@dataclass
class Outcome:
    contacts: int = 0
    peak: float = 0.0
    last: float = 0.0  # Force at the end [N]


def tapped(
    robot: Robot, limit: PressLimit, tap: Tap, tick: float, until: float, felt: Callable[[RobotReading], RobotReading]
) -> Outcome:
    """The loop of `RobotPort`, with a hand in place of the link."""
    guard = Guard(
        [limit], workspace=((-1.0,) * 3, (1.0,) * 3), trips=(inf,), speed=SPEED, approach_speed=SPEED,
        ramp=0.05, trip_retract=0.01,
    )  # fmt: skip
    robot.open(0.0)
    goal: Any = robot.latest(0.0).position
    guard.place(goal)
    outcome, touches = Outcome(), False
    for index in range(1, round(until / tick) + 1):
        reading = felt(robot.latest(index * tick))
        force = abs(reading.force[2])
        touched, touches = touches, force >= LEAST_CONTACT
        outcome.contacts += touches and not touched
        outcome.peak, outcome.last = max(outcome.peak, force), force
        if index % tap.hold == 0:
            goal = (0.0, 0.0, tap.at(index * tick))
        applied: Any = guard.follow(goal, reading.position, reading.force, tick)
        robot.command(applied, index * tick)
    return outcome


@dataclass(frozen=True)
class Case:
    """A robot, None for one without mass, and a surface."""

    mass: float | None
    stiffness: float
    damping: float
    rate: float = 1000.0
    coupling: float = 2500.0
    most: float = 10.0

    def robot(self) -> Robot:
        scene = wall(self.stiffness, self.damping or None)
        common = {"stiffness_n_m": self.coupling, "force_n": 1e4, "workspace_m": 1.0, "home_m": (0.0, 0.0, HEIGHT)}
        if self.mass is None:
            return PointRobot(PointOptions.model_validate(common), scene, 1.0 / self.rate)
        return SimulatedRobot(SimulatedOptions.model_validate({**common, "mass_kg": self.mass}), scene, 1.0 / self.rate)

    def outcomes(
        self, tap: Tap, until: float, felt: Callable[[RobotReading], RobotReading] = lambda reading: reading
    ) -> tuple[Outcome, Outcome]:
        """Without a limit, and with it."""
        free, limited = (
            PressLimit(most, self.coupling, damping=100.0, contact=LEAST_CONTACT) for most in (inf, self.most)
        )
        tick = 1.0 / self.rate
        return tapped(self.robot(), free, tap, tick, until, felt), tapped(self.robot(), limited, tap, tick, until, felt)


cases = st.builds(
    Case,
    mass=st.none() | tenfold(0.01, 5.0),
    stiffness=tenfold(100.0, 10_000.0),
    damping=st.just(0.0) | st.floats(0.0, 50.0),
    rate=st.sampled_from([250.0, 500.0, 1000.0, 2000.0, 4000.0]),
    coupling=tenfold(500.0, 10_000.0),
    most=st.floats(2.0, 30.0),
)
taps = st.builds(
    Tap, speed=tenfold(0.05, 2.0), depth=st.floats(0.005, 0.04), rest=st.floats(0.0, 0.2), hold=st.integers(1, 8)
)
FAST = Tap(speed=0.5, taps=4)


@examples(25)
@given(cases, taps)
@example(Case(None, 500.0, 20.0), FAST)
@example(Case(None, 2500.0, 20.0), FAST)
@example(Case(None, 500.0, 50.0, rate=4000.0), Tap(speed=0.05))
@example(Case(None, 10_000.0, 50.0, rate=250.0), Tap(speed=2.0, depth=0.04, taps=4))
@example(Case(0.2, 500.0, 50.0), Tap(speed=1.0, depth=0.03, rest=0.05, taps=3))
@example(Case(5.0, 10_000.0, 0.0), Tap(speed=1.0, depth=0.03, rest=0.2, taps=3))
def test_limit_makes_no_contacts_and_no_force_that_would_not_be_there_without_it(case: Case, tap: Tap) -> None:
    free, limited = case.outcomes(tap, tap.taps * tap.period)
    # An impact may end with the motion that made it: where the surface is too soft to be felt there, and once more
    # until it is known how the force answers to motion.
    assert limited.contacts <= max(free.contacts, tap.taps) + 2 * tap.taps
    assert limited.peak <= max(1.03 * free.peak, 1.05 * case.most)


@examples(25)
@given(cases, taps)
@example(Case(None, 500.0, 20.0), FAST)
@example(Case(0.01, 10_000.0, 50.0), FAST)
@example(Case(5.0, 10_000.0, 0.0), FAST)
def test_who_goes_on_pressing_presses_with_no_more_than_the_limit(case: Case, tap: Tap) -> None:
    still = Tap(tap.speed, tap.depth, rest=1.0, hold=tap.hold)
    _, limited = case.outcomes(still, still.way_time + still.rest)
    assert limited.last <= 1.02 * case.most


@pytest.mark.parametrize("damping", [0.0, 20.0])
@pytest.mark.parametrize("stiffness", [1000.0, 10_000.0])
@pytest.mark.parametrize("mass", [None, 0.01, 0.5])
def test_the_robot_presses_as_far_as_the_limit_lets_it(mass: float | None, stiffness: float, damping: float) -> None:
    tap = Tap(speed=0.3, depth=0.03, rest=0.7)
    free, limited = Case(mass, stiffness, damping).outcomes(tap, tap.way_time + tap.rest)
    assert free.last > 12.0
    assert limited.last == pytest.approx(10.0, rel=0.05)


@pytest.mark.parametrize("mass", [None, 0.01, 0.2])
def test_where_the_robot_does_not_press_too_much_it_follows_as_without_a_limit(mass: float | None) -> None:
    tap = Tap(speed=0.05, depth=0.012)
    free, limited = Case(mass, 500.0, 20.0).outcomes(tap, tap.taps * tap.period)
    assert free.contacts == tap.taps
    assert free == limited


@pytest.mark.parametrize("mass", [None, 0.01, 0.2])
def test_noise_of_the_sensors_makes_the_robot_no_slower(mass: float | None) -> None:
    noise = [((index * 7919) % 101 - 50) / 50.0 for index in range(9973)]
    count = iter(range(10**9))

    def noisy(reading: RobotReading) -> RobotReading:
        index = next(count)
        jitter, ripple = 2e-5 * noise[index % len(noise)], 0.03 * noise[(3 * index) % len(noise)]
        (x, y, z), (u, v, w) = reading.position, reading.force
        return reading._replace(position=(x, y, z + jitter), force=(u, v, w + ripple))

    tap = Tap(speed=0.5, depth=0.03, rest=0.5)
    _, limited = Case(mass, 1000.0, 0.0).outcomes(tap, tap.way_time + 0.3, noisy)
    assert limited.last == pytest.approx(10.0, rel=0.05)


@given(elastic=st.floats(0.02, 1.0), damped=tenfold(0.01, 200.0), step=st.floats(1e-3, 1.0), depth=st.floats(0.0, 0.9))
@example(elastic=0.2, damped=100.0, step=1e-3, depth=0.9)
@example(elastic=1.0, damped=1.0, step=0.5, depth=0.5)
def test_press_that_follows_motion_as_well_as_depth_settles_at_the_limit(
    elastic: float, damped: float, step: float, depth: float
) -> None:
    """p[k] = K d[k] + B (d[k] - d[k-1]), in units of the limit and of the robot's stiffness."""
    limit, presses = PressStep(1.0, 200.0 * 1e-3), []
    place, went, before = depth / elastic, 0.0, depth
    for _ in range(ceil(60.0 * (1.0 + damped) / elastic)):
        press = max(0.0, elastic * place + damped * went)
        presses.append(press)
        went, before = limit.allowed(step if len(presses) == 1 else inf, press, before, went, 1e-3), press
        place += went
    first = next((index for index, press in enumerate(presses) if press > 1.0), len(presses))
    assert sum(press > 1.0 + 1e-9 for press in presses[first + 1 :]) <= 3
    assert presses[-1] == pytest.approx(1.0, rel=1e-3)


def pushed_axis(limit: PressLimit | None, *, damping: float) -> tuple[int, float]:
    """An axis without inertia, on a stop of 10 N m/rad: how often it meets the stop, and the torque at the end."""
    coupling, tick = 50.0, 1e-3
    held = angle = torque = depth = 0.0
    contacts = 0
    for index in range(3000):
        before, depth = depth, max(0.0, held)
        touched = torque < 0.0
        torque = min(0.0, -10.0 * depth - damping * (depth - before) / tick)
        contacts += torque < 0.0 and not touched
        angle = held + torque / coupling
        target = min(0.5, -0.05 + 3.0 * index * tick)
        held = target if limit is None else limit.bounded((target,), (held,), (angle,), (torque,), tick)[0]
    return contacts, torque


@pytest.mark.parametrize("damping", [0.0, 0.1, 0.5, 2.0])
def test_axis_without_inertia_does_not_bounce_off_a_damped_stop(damping: float) -> None:
    contacts, torque = pushed_axis(None, damping=damping)
    assert contacts == 1
    assert torque == pytest.approx(-5.0)
    contacts, torque = pushed_axis(axis_press_limit(1.0, 50.0, 0.0), damping=damping)
    assert contacts <= 3
    assert torque == pytest.approx(-1.0, rel=0.1)
