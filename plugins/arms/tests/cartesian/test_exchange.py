"""The cycle of control on the emulated arm, in virtual time: it holds, follows, feels, and says what went wrong."""

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import pytest

from plugins.arms.tests import benches
from weberlink.geometry.vector import Vector, distance, norm
from weberlink.hardware.fault import HardwareFault
from weberlink.testing.stepping import KilledError
from weberlink_arms.cartesian.arm import LEAST_ROTOR_INERTIA_KG_M2, Joints, Mechanics
from weberlink_arms.cartesian.exchange import ArmExchange, TipSample
from weberlink_arms.cartesian.external_force import force_error
from weberlink_arms.cartesian.impedance import fastest_damping, stiffest
from weberlink_arms.cartesian.options import DynamixelOptions, poses, worst_force_error
from weberlink_arms.dynamixel import registers
from weberlink_arms.emulators.open_manipulator import DynamixelEmulator, DynamixelEmulatorOptions as EmulatedOptions

POSE = Mechanics().pose
AT_WORK: Vector = (0.2, 0.03, 0.13)
FLOOR_Z = 0.1
SWIFT = DynamixelOptions(approach_m_s=0.5)
FLOOR = {"shape": "plane", "point_m": [0.0, 0.0, FLOOR_Z], "stiffness_n_m": 1000.0}


class Bench(benches.Bench):
    """An arm, and the exchange that drives it at its rate."""

    def __init__(
        self, options: DynamixelOptions | None = None, emulated: EmulatedOptions | None = None, latency: float = 0.0
    ) -> None:
        super().__init__(options or DynamixelOptions(), DynamixelEmulator(emulated), latency)
        clock, pause = self.time.clock, self.time.pause
        self.exchange: Any = ArmExchange(self.options, self._connect, clock=clock, pause=pause)

    def lead(self, goal: Vector, speed: float = 0.1) -> TipSample:
        """Command a straight way there [m/s]; gives the last sample."""
        (sample,) = self.run(None, 1.0 / self.options.rate_hz)
        start = sample.tip
        count = max(1, round(distance(start, goal) / speed * self.options.rate_hz))
        for number in range(1, count + 1):
            x, y, z = (a + number / count * (b - a) for a, b in zip(start, goal, strict=True))
            (sample,) = self.run((x, y, z), 1.0 / self.options.rate_hz)
        return sample

    def register(self, name: str) -> list[int]:
        """Of joints 1 to 4."""
        return super().register(name)[:4]

    def write(self, joint: int, name: str, value: int) -> None:
        register = registers.BY_NAME[name]
        assert self.emulator.servos[joint - 1].write(register.address, register.encode(value)) == 0


def at_work() -> Bench:
    bench = Bench(SWIFT)
    bench.exchange.open()
    bench.lead(AT_WORK, 0.4)
    bench.run(AT_WORK, 0.4)
    return bench


def test_opening_takes_over_the_weight_and_moves_nothing() -> None:
    bench = Bench()
    before = bench.emulator.tip
    sample = bench.exchange.open()
    assert distance(sample.tip, before) < 1e-3
    bench.run(None, 0.4)
    assert not bench.emulator.held
    assert distance(bench.emulator.tip, before) < 2e-3
    assert bench.register("bus_watchdog") == [4] * 4  # x 20 ms
    assert bench.register("operating_mode") == [registers.MODE_CURRENT] * 4
    assert bench.register("return_delay_time") == [0] * 4
    assert [servo.torque_on for servo in bench.emulator.servos] == [True] * 4 + [False], "the gripper is not ours"


SWEPT: Joints = (0.037, 0.085, 0.132, 0.045)
FITTED: Joints = (0.0168, 0.0089, 0.0094, 0.0377)
"""Dry friction of the same arm by two methods of the same project [N m]."""
NOISE_N = 0.3  # of the estimate: of the measured currents, and of an arm that is not quite at rest


def test_without_a_pitch_that_is_wanted_the_gripper_is_level_where_it_can_be() -> None:
    assert any(pose.pitch == pytest.approx(0.0, abs=1e-9) for pose in poses(DynamixelOptions()))


@pytest.mark.parametrize(
    ("constant", "taken_for", "uncertain", "coulomb", "rotor"),
    [(2.48, 1.78, 0.4, SWEPT, 0.045), (1.78, 1.78, 0.4, FITTED, 0.005), (1.65, 1.60, 0.05, SWEPT, 0.005)],
)
def test_force_of_published_arms_is_within_stated_error(
    constant: float, taken_for: float, uncertain: float, coulomb: Joints, rotor: float
) -> None:
    options = SWIFT.model_copy(update={"torque_constant_n_m_a": taken_for, "torque_constant_error": uncertain})
    arm = {"torque_constant_n_m_a": constant, "coulomb_n_m": coulomb, "rotor_inertia_kg_m2": rotor, "scene": [FLOOR]}
    bench = Bench(options, EmulatedOptions.model_validate(arm))
    bench.exchange.open()
    stated = worst_force_error(options)
    for goal in ((0.24, 0.05, 0.12), (0.2, 0.02, FLOOR_Z - 0.011)):
        bench.lead(goal, 0.3)
        sample = bench.run(goal, 0.5)[-1]
        wrong = distance(sample.force, bench.emulator.tip_force)
        assert wrong <= stated[0] + stated[1] * norm(sample.force)
        newtons, share = force_error(POSE(sample.joints), options.friction, uncertain)
        assert wrong <= newtons + share * norm(sample.force) + NOISE_N, f"within the bound of this pose, at {goal}"


def test_the_lightest_and_strongest_arm_comes_to_rest_with_the_largest_gains() -> None:
    damping = fastest_damping(250.0, 0.045)
    strongest = {"damping_rate_s": damping, "stiffness_n_m": stiffest(damping, 250.0, 0.045)}
    options = SWIFT.model_copy(update={**strongest, "rotor_inertia_kg_m2": 0.045})
    arm = {"torque_constant_n_m_a": 2.48, "rotor_inertia_kg_m2": LEAST_ROTOR_INERTIA_KG_M2, "current_noise_ma": 0.0}
    bench = Bench(options, EmulatedOptions.model_validate(arm))
    bench.exchange.open()
    bench.lead(AT_WORK, 0.4)
    tips = [sample.tip for sample in bench.run(AT_WORK, 1.6)[-100:]]
    assert max(distance(tip, tips[-1]) for tip in tips) < 2e-3


def pressing() -> Bench:
    """On the floor, with a few newtons."""
    bench = Bench(SWIFT, EmulatedOptions.model_validate({"scene": [FLOOR]}))
    bench.exchange.open()
    goal = (0.2, 0.02, FLOOR_Z - 0.02)
    bench.lead(goal, 0.2)
    bench.run(goal, 0.2)
    return bench


def test_a_host_that_is_killed_or_stopped_lets_go_within_100_ms() -> None:
    """And one that goes on afterwards takes nothing up, but holds the arm where it lies."""
    bench = pressing()
    pressed = bench.emulator.tip_force[2]
    bench.wait(0.07)
    assert max(map(abs, bench.emulator.currents[:4])) > 0.0
    bench.wait(0.03)
    for _ in range(4):
        assert bench.emulator.currents[:4] == [0.0] * 4
        bench.wait(0.1)
    where = bench.emulator.tip
    bench.emulator.largest_current = 0.0
    with pytest.raises(HardwareFault, match="bus watchdog tripped"):
        bench.exchange.exchange((0.2, 0.02, FLOOR_Z - 0.02))
    bench.exchange.close()
    bench.wait(0.3)
    assert bench.emulator.largest_current <= 1e-3 * bench.options.max_current_ma
    assert bench.emulator.tip_force[2] < pressed
    assert distance(bench.emulator.tip, where) < 0.01
    assert bench.register("torque_enable") == [1] * 4


def test_arm_resumes_without_jump_after_host_sleep() -> None:
    bench = at_work()
    bench.wait(0.35)
    assert bench.emulator.watchdog_trips == 4
    with pytest.raises(HardwareFault, match="watchdog"):
        bench.exchange.exchange(AT_WORK)
    bench.exchange.close()
    found = bench.exchange.open().tip
    bench.run(None, 0.1)
    assert distance(bench.emulator.tip, found) < 0.02, "caught while it fell"
    tips = [sample.tip for sample in bench.run(AT_WORK, 0.8)]
    for a, b in pairwise(tips[::5]):
        assert distance(a, b) < 0.7 * 0.02, "approaches at 0.5 m/s"
    assert distance(tips[-1], AT_WORK) < 0.006


@pytest.mark.parametrize(("allowed_ma", "of_the_motor"), [(700.0, 1193), (1000.0, 1193), (1000.0, 300)])
def test_holding_motors_have_limited_current(allowed_ma: float, of_the_motor: int) -> None:
    bench = Bench(DynamixelOptions(approach_m_s=0.5, max_current_ma=allowed_ma))
    bench.write(3, "current_limit", of_the_motor)
    bench.exchange.open()
    bench.lead(AT_WORK, 0.4)
    bench.exchange.close()
    most = min(int(allowed_ma / 2.69), of_the_motor)
    assert bench.register("goal_current") == [most] * 4
    assert bench.register("operating_mode") == [registers.MODE_CURRENT_BASED_POSITION] * 4
    assert (bench.register("torque_enable"), bench.register("bus_watchdog")) == ([1] * 4, [0] * 4)
    where = bench.emulator.tip
    bench.wait(0.5)
    assert distance(bench.emulator.tip, where) < 0.015
    for servo in bench.emulator.servos[:4]:
        assert servo.drive.limit <= most * registers.A_PER_COUNT + 1e-9


def test_host_killed_while_closing_leaves_bounded_motors() -> None:
    """With a watchdog that is off, a motor is limp or holds within the limit; with one that is on, it goes limp."""
    steps = 0
    while True:
        bench = Bench()
        bench.exchange.open()
        bench.port.killed_after = steps
        try:
            bench.exchange.close()
        except KilledError:
            ended = False
        else:
            ended = True
        bench.wait(0.085)
        for servo in bench.emulator.servos[:4]:
            drive = servo.drive
            assert not drive.on or drive.current == 0.0 or (drive.current is None and drive.limit <= 1.0), steps
        if ended:
            break
        steps += 1
    assert steps > 20


@pytest.mark.parametrize(
    ("spoil", "says"),
    [
        (lambda bench: bench.write(2, "drive_mode", 1), "joint 2 (id 12): runs in reverse; clear bit 0"),
        (lambda bench: bench.write(3, "homing_offset", 1000), "joint 3 (id 13): stands at 1.88 rad"),
        (lambda bench: bench.write(2, "current_limit", 100), "of 100 is too low to carry the arm"),
        (lambda bench: setattr(bench.port, "latency", 0.006), "takes 7.0 ms at best, 250 Hz leave 4.0 ms"),
    ],
)
def test_opening_refuses_a_wrong_arm_before_torque(spoil: Callable[[Bench], None], says: str) -> None:
    bench = Bench()
    spoil(bench)
    with pytest.raises(HardwareFault) as caught:
        bench.exchange.open()
    assert says in str(caught.value)
    assert "\n" not in str(caught.value)
    assert bench.emulator.held, "nothing was switched on"
