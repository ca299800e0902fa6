"""Every arm with servos on a bench in virtual time: the emulated arm, and the exchange that drives it."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from weberlink.geometry.joints import Joints
from weberlink.hardware.fault import HardwareFault
from weberlink.hardware.guardian import Guardian
from weberlink.testing.stepping import SteppedWorker, VirtualPort, VirtualTime
from weberlink.testing.time import TICK
from weberlink_arms.dynamixel.exchange import PositionExchange, TorqueExchange
from weberlink_arms.dynamixel.follower import KochFollowerOptions, OpenManipulatorXOptions
from weberlink_arms.dynamixel.leader import KochLeaderOptions, OmxLeaderOptions
from weberlink_arms.emulators.dynamixel.arm import KochFollowerEmulator, KochLeaderEmulator, OmxLeaderEmulator
from weberlink_arms.emulators.feetech import FeetechEmulator, So101LeaderEmulator
from weberlink_arms.emulators.feetech_servo import EmulatedServo
from weberlink_arms.emulators.open_manipulator import DynamixelEmulator
from weberlink_arms.feetech.follower import FollowerExchange, So101FollowerOptions
from weberlink_arms.feetech.leader import LeaderExchange, So101LeaderOptions
from weberlink_arms.servo.exchange import Gravity, gravity_of, no_gravity

STILL = (0.0,) * 6


def _so101_leader(options: Any, connect: Any, gravity: Gravity, clock: Any, pause: Any) -> Any:
    return LeaderExchange(options, connect, Guardian(b""), clock, pause)


@dataclass(frozen=True)
class Family:
    """A kind of arm."""

    emulator: Callable[[Any], Any]  # its class
    emulated: dict[str, Any]  # options of it, for an arm that rests
    options: Any  # class of those of the driver
    exchange: Callable[..., Any]  # makes it
    rest: Joints | None  # the command that is safe at any time
    torque: float = 0.0  # that it displays well [N m], on axes 0, 2 and the last
    within: float = 0.0  # how well
    gravity: Gravity = no_gravity  # that the exchange takes for the weight

    @property
    def leads(self) -> bool:
        return self.rest is not None


QUIET = {"current_noise_ma": 0.0}
HELD = {"hand_rad": STILL, "hand_n_m_rad": 5.0, "friction_nm": 0.01}
WEIGHT = gravity_of("open_manipulator_x", wanted=True)
IN_HAND = QUIET | {"hand_rad": STILL}
FAMILIES = {
    "koch_leader": Family(KochLeaderEmulator, IN_HAND, KochLeaderOptions, TorqueExchange, STILL, 0.06, 0.004),
    "omx_leader": Family(OmxLeaderEmulator, IN_HAND, OmxLeaderOptions, TorqueExchange, STILL, 0.06, 0.004),
    "so101_leader": Family(So101LeaderEmulator, HELD, So101LeaderOptions, _so101_leader, STILL, 0.15, 0.045),
    "koch_follower": Family(KochFollowerEmulator, QUIET, KochFollowerOptions, PositionExchange, None),
    "so101_follower": Family(FeetechEmulator, {}, So101FollowerOptions, FollowerExchange, None),
    "open_manipulator_x": Family(
        DynamixelEmulator, QUIET, OpenManipulatorXOptions, PositionExchange, None, gravity=WEIGHT
    ),
}
LEADERS = [name for name, family in FAMILIES.items() if family.leads]
FOLLOWERS = [name for name, family in FAMILIES.items() if not family.leads]


class Bench:
    """An arm, its exchange and their time."""

    exchange: Any
    sample: Any

    def __init__(self, options: Any, emulator: Any, latency: float = 0.0) -> None:
        self.options, self.emulator, self.time = options, emulator, VirtualTime()
        self.port = VirtualPort(emulator, self.time, latency)

    def _connect(self) -> VirtualPort:
        if self.port.broken is not None:
            raise self.port.broken
        self.port.closed = False
        return self.port

    def open(self) -> Any:
        self.sample = self.exchange.open()
        return self.sample

    def run(self, command: Any, seconds: float) -> list[Any]:
        """Cycles at the rate of the bus; a command that is a function is made from the sample before."""
        period, due, samples = 1.0 / self.options.rate_hz, self.time.now, []
        for _ in range(round(seconds / period)):
            due = max(due + period, self.time.now)
            self.time.now = due
            self.sample = self.exchange.exchange(command(self.sample) if callable(command) else command)
            samples.append(self.sample)
        return samples

    def wait(self, seconds: float) -> None:
        """Time passes, and nobody does anything."""
        self.time.now += seconds
        self.emulator.advance(self.time.now)

    def register(self, name: str) -> list[int]:
        """A register of all servos."""
        servos = self.emulator.servos
        return [servo[name] if isinstance(servo, EmulatedServo) else servo.registers[name] for servo in servos]


class ArmBench(Bench):
    """Of a family; `carried` is taken for the weight, instead of what the family takes."""

    def __init__(self, name: str, options: dict[str, Any], carried: Gravity | None = None, **emulated: Any) -> None:
        family = self.family = FAMILIES[name]
        super().__init__(family.options.model_validate(options), made(name, **emulated))
        clock, pause = self.time.clock, self.time.pause
        self.exchange = family.exchange(self.options, self._connect, carried or family.gravity, clock, pause)

    def inject(self, fault: str, value: float) -> None:
        """One of the emulator's, or the faults of its wire."""
        if fault in ("silent", "garble"):
            setattr(self.emulator.faults, fault, value)
        elif fault == "power":
            register = 40 if isinstance(self.emulator, FeetechEmulator) else 64
            self.emulator.servos[int(value) - 1].write(register, b"\0")
        else:
            self.emulator.inject(fault, value)
            self.wait(0.0)

    @property
    def displayed(self) -> Joints:
        """Torques on the hand, along the angles of the emulated arm [N m]."""
        return tuple(self.emulator.motor_nm)

    @property
    def angles(self) -> Joints:
        """Of the emulated arm [rad]."""
        return tuple(self.emulator.angles)

    @property
    def limits(self) -> dict[str, list[float]]:
        """Range of the angles, as options [rad]."""
        return {"lower_rad": [*self.options.lower], "upper_rad": [*self.options.upper]}

    @property
    def torques_on(self) -> list[bool]:
        return [servo.torque_on for servo in self.emulator.servos]


def opened(
    name: str, options: dict[str, Any] | None = None, carried: Gravity | None = None, **emulated: Any
) -> ArmBench:
    bench = ArmBench(name, options or {}, carried, **emulated)
    bench.open()
    return bench


def only(axis: int, value: float, others: Joints = STILL) -> Joints:
    return (*others[:axis], value, *others[axis + 1 :])


def made(name: str, **options: Any) -> Any:
    """The arm of a family."""
    family = FAMILIES[name]
    return family.emulator(family.emulator.Options.model_validate(family.emulated | options))  # type: ignore[attr-defined]


class Stepped(Bench):
    """A driver in virtual time, before an emulated arm."""

    def __init__(self, driver: Any, emulator: Any) -> None:
        super().__init__(None, emulator)
        self._worker = SteppedWorker.of(driver, self.time.clock)
        exchange = self._worker.exchange._exchange
        exchange._connect, exchange._clock, exchange._pause = self._connect, self.time.clock, self.time.pause
        exchange._guardian = None

    def tick(self) -> float:
        self.time.now += TICK
        self._worker.step()
        return self.time.now

    @property
    def faults(self) -> dict[str, Callable[[], None]]:
        emulator, port = self.emulator, self.port
        return {
            "unplug": lambda: setattr(port, "broken", HardwareFault(f"{port.path}: unplugged")),
            "silent": lambda: setattr(emulator.faults, "silent", True),
            "late": lambda: setattr(port, "latency", 0.2),
            "garbled": lambda: setattr(emulator.faults, "garble", 1_000_000),
        } | {name: lambda name=name: emulator.inject(name, 1) for name in emulator.OWN_FAULTS}
