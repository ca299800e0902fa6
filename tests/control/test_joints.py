"""Schemes for joints, between the hands of an operator and a wall that one or several joints press on."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from math import hypot, inf, nan, pi, sin
from random import Random
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.control.teleoperation import QUIET, TICK, Direction, Hand, Link, Quality, advance
from tests.examples import examples
from weberlink.control.contract import CREDIT_STEP, Control, SchemeParameters
from weberlink.control.energy import STRONGEST
from weberlink.control.force_port import DEBT
from weberlink.control.joints import (
    JOINT_SCHEMES,
    JointParameters,
    TdpaJointMaster,
    TdpaJointSlave,
    build_joint_master,
    build_joint_slave,
)
from weberlink.control.table import SCHEMES
from weberlink.control.tdpa import TdpaMaster, TdpaSlave
from weberlink.geometry.joints import Joints, is_finite

LEVER = 0.2
AXES = 7
LIMIT = 2.0
"""Largest torque on the operator's hand [N m]."""
RANGE = 6.0
"""Range of the follower's measurement [N m]."""
COUPLING = 100.0
"""Stiffness of the follower's joints [N m/rad]."""
SETTINGS = JointParameters(
    tick_period=TICK,
    torque_range=(RANGE,) * AXES,
    level=0.05,
    damping=5.0,
    catch_up_rad_s=1.25,
    coupling=(COUPLING,) * AXES,
    lever=LEVER,
)
BOUND = 2e-3
"""Largest energy that may seem to be created [J]: the debts of the tanks and of the ports of the three parts."""
HAND = Hand(mass=0.012, stiffness=12.0, damping=0.32)
"""Of each joint: inertia [kg m^2], stiffness [N m/rad] and damping [N m s/rad] of the operator's arm."""
ELBOW: Joints = (0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0)
SLANTED: Joints = (0.4, 0.0, 0.8, 0.0, 0.5, 0.0, -0.3)
"""Angles change the depth in a wall by so much: joints of all parts press on it."""


@dataclass
class Course:
    """The result of a run per tick: cumulative work at the ports [J], torques [N m] and angles [rad]."""

    given: list[float] = field(default_factory=lambda: [0.0])
    taken: list[float] = field(default_factory=lambda: [0.0])
    torques: list[Joints] = field(default_factory=list)
    wall_torques: list[Joints] = field(default_factory=list)
    hand: list[Joints] = field(default_factory=list)
    robot: list[Joints] = field(default_factory=list)

    @property
    def generated(self) -> float:
        """The most energy that came out of either port pair beyond what went in [J]."""
        at_the_hand = -min(0.0, *self.given)
        return max(at_the_hand, -min(0.0, *(a - b for a, b in zip(self.given, self.taken, strict=True))))

    @staticmethod
    def largest(values: list[Joints]) -> float:
        return max(abs(value) for joints in values for value in joints)


def intention(at: float, *, sways: bool = True) -> Joints:
    """A press of the wall for 1.5 s, then taps at 4 Hz, while the other joints sway [rad]."""
    if at < 1.5:
        phase = at / 1.5
        press = 0.05 - 0.13 * min(1.0, 4.0 * phase, max(0.0, 4.0 * (0.9 - phase)))
    else:
        press = 0.08 * sin(2.0 * pi * 4.0 * (at - 1.5)) - 0.01
    sway = [0.02 * sways * sin(2.0 * pi * rate * at) for rate in (0.7, 1.1, 0.0, 1.9, 2.3, 3.1, 0.9)]
    return tuple(sway[axis] + press * (axis in (2, 4)) for axis in range(AXES))


def wall(stiffness: float, normal: Joints) -> Callable[[Joints], Joints]:
    """The torques of an elastic wall below the plane of angles through 0 with this normal [N m]."""

    def torques(angles: Joints) -> Joints:
        depth = -sum(n * q for n, q in zip(normal, angles, strict=True))
        return tuple(min(RANGE, max(0.0, stiffness * depth)) * n for n in normal)

    return torques


def operate(
    scheme: str,
    *,
    stiffness: float,
    normal: Joints = ELBOW,
    link: Link,
    hand: Hand = HAND,
    seconds: float = 2.1,
    sways: bool = True,
) -> Course:
    """Run both ends from rest; each tick sends all axes and the credit."""
    master, slave = build_joint_master(scheme, SETTINGS), build_joint_slave(scheme, SETTINGS)
    touched = wall(stiffness * COUPLING / (COUPLING + stiffness), normal)
    random, course = Random(link.seed), Course()
    angles, speeds, felt = intention(0.0), (0.0,) * AXES, (0.0,) * AXES
    robot, torques = angles, (0.0,) * AXES
    forward, backward = Direction(link, random, (angles, 0)), Direction(link, random, (torques, 0))
    quality = QUIET if link.delay == 0.0 else Quality(2.0 * link.delay, link.jitter)
    for tick in range(round(seconds / TICK)):
        wanted, moved = intention(tick * TICK, sways=sways), angles
        states = [advance(hand, hand.parts, *joint) for joint in zip(angles, speeds, felt, wanted, strict=True)]
        angles, speeds = tuple(at for at, _ in states), tuple(speed for _, speed in states)
        given = -sum(f * (a - b) for f, a, b in zip(felt, angles, moved, strict=True))
        master.observe(angles, TICK, tick, backward.credit, quality)
        sent = master.command(angles)
        felt = tuple(min(LIMIT, max(-LIMIT, torque)) for torque in master.render(backward.known))
        master.displayed(felt)
        forward.carry(tick, sent, master.credit)
        went, before = robot, torques
        robot = slave.follow(forward.known, robot, TICK, forward.credit, quality)
        torques = touched(robot)
        slave.observe(robot, torques)
        backward.carry(tick, torques, slave.credit)
        work = -0.5 * sum((a + b) * (q - p) for a, b, q, p in zip(before, torques, robot, went, strict=True))
        course.given.append(course.given[-1] + given)
        course.taken.append(course.taken[-1] + work)
        course.torques.append(felt)
        course.wall_torques.append(torques)
        course.hand.append(angles)
        course.robot.append(robot)
    return course


@pytest.mark.parametrize("delay", [0.0, 0.05, 0.12])
@pytest.mark.parametrize(("normal", "stiffness"), [(ELBOW, 20.0), (SLANTED, 2000.0)])
def test_tdpa_makes_no_energy(normal: Joints, stiffness: float, delay: float) -> None:
    course = operate("tdpa", stiffness=stiffness, normal=normal, link=Link(delay, loss=0.05, seed=2))
    assert course.generated <= BOUND
    assert course.largest(course.torques) >= 0.3
    assert course.largest(course.wall_torques) >= 0.6


@pytest.mark.parametrize("seed", range(2))
def test_nor_does_it_over_links_and_walls_of_chance(seed: int) -> None:
    random = Random(seed)
    normal = tuple(random.uniform(-1.0, 1.0) for _ in range(AXES))
    link = Link(random.uniform(0.0, 0.35), random.uniform(0.0, 0.1), random.uniform(0.0, 0.6), seed)
    hand = Hand(10.0 ** random.uniform(-3.0, -1.5), random.uniform(4.0, 40.0), random.uniform(0.02, 0.4))
    stiffness = 10.0 ** random.uniform(1.0, 4.0)
    course = operate("tdpa", stiffness=stiffness, normal=normal, link=link, hand=hand)
    assert course.generated <= BOUND, (stiffness, normal, link, hand)


def test_a_still_arm_pays_for_one_joint_alone() -> None:
    """Joints that move in free space fill the tank; here none does."""
    course = operate("tdpa", stiffness=200.0, link=Link(0.05, loss=0.05, seed=4), sways=False)
    assert course.generated <= BOUND
    assert course.largest(course.torques) >= 0.3
    assert all(abs(angle) < 1e-9 for angles in course.hand for axis, angle in enumerate(angles) if axis not in (2, 4))


def test_without_control_the_same_world_makes_energy() -> None:
    """Otherwise the tests above could not fail."""
    course = operate("none", stiffness=20.0, link=Link(0.05, loss=0.05, seed=2), seconds=1.5)
    assert course.generated > 100.0 * BOUND


def test_without_control_or_delay_both_ends_are_one() -> None:
    course = operate("none", stiffness=20.0, link=Link(), seconds=0.5)
    assert course.robot == course.hand
    assert course.torques[1:] == course.wall_torques[:-1]
    assert course.largest(course.torques) > 0.5


@pytest.mark.parametrize("scheme", JOINT_SCHEMES)
def test_both_ends_name_their_scheme(scheme: str) -> None:
    ends: list[Control] = [build_joint_master(scheme, SETTINGS), build_joint_slave(scheme, SETTINGS)]
    for end in ends:
        assert (end.active, end.tank, end.credit) == (scheme, 0.0, 0)
        assert end.active in SCHEMES


@pytest.mark.parametrize("build", [build_joint_master, build_joint_slave])
@pytest.mark.parametrize("scheme", ["mmt", "auto", "other"])
def test_a_scheme_that_reads_positions_is_refused(build: Callable[[str, JointParameters], object], scheme: str) -> None:
    with pytest.raises(ValueError, match="does not lead joints; use none or tdpa"):
        build(scheme, SETTINGS)


@pytest.mark.parametrize(
    "change",
    [
        {"coupling": ()},
        {"coupling": (1.0,)},
        {"coupling": (-1.0,) * AXES},
        {"torque_range": (nan,) * AXES},
        {"lever": 0.0},
        {"level": nan},
        {"tick_period": 0.0},
        {"damping": -1.0},
        {"catch_up_rad_s": inf},
    ],
)
def test_parameters_out_of_range_are_refused(change: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=next(iter(change))):
        replace(SETTINGS, **change)


def test_three_axes_at_a_lever_of_one_are_the_cartesian_scheme() -> None:
    shared = SchemeParameters(TICK, RANGE * 3.0**0.5, level=0.05, damping=5.0, catch_up_speed=1.25, coupling=COUPLING)
    joint = replace(SETTINGS, torque_range=(RANGE,) * 3, coupling=(COUPLING,) * 3, lever=1.0)
    random, credit = Random(5), 0
    master, slave = build_joint_master("tdpa", joint), build_joint_slave("tdpa", joint)
    whole, half = TdpaMaster(shared), TdpaSlave(shared)
    here = there = at = (0.0, 0.0, 0.0)
    for tick in range(600):
        at = tuple(q + random.gauss(0.0, 1e-3) for q in at)  # type: ignore[assignment]
        credit += random.random() < 0.3
        force = (max(0.0, -50.0 * here[0]), 0.0, random.gauss(0.0, 0.1))
        master.observe(at, TICK, tick, credit, QUIET)
        whole.observe(at, TICK, tick, credit, QUIET)
        shown = whole.render(force)
        assert master.render(force) == pytest.approx(shown, rel=1e-9, abs=1e-12)
        master.displayed(shown)
        whole.displayed(shown)
        there = half.follow(whole.command(at), here, TICK, credit, QUIET)
        assert slave.follow(master.command(at), here, TICK, credit, QUIET) == pytest.approx(there, rel=1e-9, abs=1e-12)
        here = there
        half.observe(here, force)
        slave.observe(here, force)
        assert (master.tank, slave.tank) == pytest.approx((whole.tank, half.tank), rel=1e-9, abs=1e-12)
        assert (master.credit, slave.credit) == (whole.credit, half.credit)


@pytest.mark.parametrize("axes", [1, 2, 4, 8, 9])
@pytest.mark.parametrize("lever", [0.05, 0.5])
def test_the_tank_books_the_exact_work_of_all_joints(axes: int, lever: float) -> None:
    random, work = Random(axes), 0.0
    master = build_joint_master("tdpa", with_axes(axes, lever))
    angles, torques = (0.0,) * axes, (0.0,) * axes
    master.observe(angles, TICK, 0.0, 0, QUIET)
    for tick in range(50):
        moved = tuple(-torque * random.uniform(0.0, 0.01) for torque in torques)  # pushed against: no energy is spilt
        angles = tuple(q + step for q, step in zip(angles, moved, strict=True))
        work -= sum(torque * step for torque, step in zip(torques, moved, strict=True))
        master.observe(angles, TICK, tick, 0, QUIET)
        torques = tuple(random.uniform(-0.1, 0.1) for _ in range(axes))
        master.render(torques)
        master.displayed(torques)
    assert 0.0 < work < 0.1
    assert abs(master.tank + master.credit * CREDIT_STEP - work) <= CREDIT_STEP


def test_the_energy_of_one_joint_pays_for_another() -> None:
    """The hand turns joint 0 against a torque; then joint 6, of another part, may push the hand out."""
    pushes: list[float] = []
    for earned in (False, True):
        master = build_joint_master("tdpa", SETTINGS)
        angles, pushed = [0.0] * AXES, 0.0
        for tick in range(400):
            angles[0] -= 1e-3 * (earned and tick < 200)
            angles[6] += 2e-4 * (tick >= 200)
            master.observe(tuple(angles), TICK, tick, 0, QUIET)
            torques = master.render((1.0, *(0.0,) * 6) if tick < 200 else (*(0.0,) * 6, 1.0))
            master.displayed(torques)
            pushed = max(pushed, torques[6])
        pushes.append(pushed)
    assert pushes[0] < 0.1
    assert pushes[1] > 0.5


@pytest.mark.parametrize("earned", [0, 300])
def test_parts_together_take_no_more_than_the_tank_has(earned: int) -> None:
    """First all joints turn against the torque; then at every tick they turn with it, in another direction."""
    master = build_joint_master("tdpa", SETTINGS)
    angles, lowest = (0.0,) * AXES, 0.0
    for tick in range(earned + 500):
        way = -1.0 if tick < earned else (-1.0) ** tick
        torques = master.render((1.0 if tick < earned else way,) * AXES)
        master.displayed(torques)
        angles = tuple(q + 1e-3 * way for q in angles)
        master.observe(angles, TICK, tick, 0, QUIET)
        lowest = min(lowest, master.tank)
    assert -3.0 * DEBT * (1.0 + 1e-5) <= lowest <= -DEBT


@pytest.mark.parametrize("end", ["master", "slave"])
def test_an_interruption_keeps_debt_and_credit(end: str) -> None:
    control = build_joint_master("tdpa", SETTINGS) if end == "master" else build_joint_slave("tdpa", SETTINGS)
    for tick in range(300):
        angle = -1e-3 * tick
        if isinstance(control, TdpaJointMaster):
            control.observe((angle,) * AXES, TICK, tick, 0, QUIET)
            control.displayed((0.5,) * AXES)
        else:
            assert isinstance(control, TdpaJointSlave)
            control.follow((angle,) * AXES, (angle,) * AXES, TICK, 600 + tick, QUIET)
            control.observe((angle,) * AXES, (0.0,) * AXES)
    credit = control.credit
    assert credit > 0
    control.resume(10_000)
    assert control.credit == credit
    assert control.tank == 0.0
    control.reset()
    assert (control.credit, control.tank) == (0, 0.0)


@given(
    ideal=st.booleans(),
    ticks=st.lists(
        st.tuples(st.tuples(*[st.floats(-1e6, 1e6)] * 4), st.tuples(*[st.floats(-1e3, 1e3)] * 4), st.integers(0, 99)),
        max_size=15,
    ),
)
@examples(25)
def test_nothing_finite_makes_a_scheme_raise_or_infinite(ideal: bool, ticks: list[tuple[Joints, Joints, int]]) -> None:
    settings = with_axes(4, LEVER)
    if ideal:
        settings = replace(settings, torque_range=(inf,) * 4, coupling=(inf,) * 4)
    master, slave = build_joint_master("tdpa", settings), build_joint_slave("tdpa", settings)
    here: Joints = (0.0,) * 4
    for tick, (angles, torques, credit) in enumerate(ticks):
        master.observe(angles, TICK, tick, credit, QUIET)
        shown = master.render(torques)
        master.displayed(shown)
        here = slave.follow(angles, here, TICK, credit, QUIET)
        slave.observe(here, torques)
        assert len(shown) == len(here) == 4
        assert is_finite((*shown, *here, master.tank, slave.tank))
        # Two parts, the drag of each at most 1 N at the lever.
        assert hypot(*shown) <= hypot(*torques) + 2.0 * STRONGEST * LEVER + 1e-9


def with_axes(axes: int, lever: float) -> JointParameters:
    return replace(SETTINGS, torque_range=(RANGE,) * axes, coupling=(COUPLING,) * axes, lever=lever)
