"""The robot `dynamixel`: an OpenMANIPULATOR-X under Cartesian impedance, with its bus in a thread."""

from time import monotonic, sleep
from typing import ClassVar, Final

from weberlink.geometry.vector import Vector, add, distance, is_finite, scale, subtract, within
from weberlink.hardware.discovery import PluggedDevice, UsbId, only, serial_ports
from weberlink.hardware.serial_port import SerialPort
from weberlink.hardware.worker import ThreadedDriver
from weberlink.registry import Tier
from weberlink.slave.robots.contract import RobotFault, RobotReading, RobotSpec
from weberlink.slave.scenes.scene import Scene
from weberlink_arms.cartesian.exchange import ArmExchange, ArmSample
from weberlink_arms.cartesian.options import DynamixelOptions, OnClose, worst_force_error
from weberlink_arms.dynamixel import registers
from weberlink_arms.dynamixel.bus import USB, latency_advice
from weberlink_arms.dynamixel.motors import watchdog_units
from weberlink_arms.interpolation import Interpolation
from weberlink_arms.servo.filter import LowPass

NAME: Final = "dynamixel"
STALE_S: Final = 0.1
REACHED_M: Final = 0.015
REST_STEP_S: Final = 0.01
REST_MOST_S: Final = 10.0


class DynamixelRobot(ThreadedDriver[Vector | None, ArmSample]):
    """Readings are interpolated between the cycles of the bus, and late by the lag that the spec states.

    Raises:
        ValueError: a scene was given.
    """

    FAULT = RobotFault
    TIER: ClassVar[Tier] = "emulated only"
    Options = DynamixelOptions
    USB: ClassVar[tuple[UsbId, ...]] = USB

    @classmethod
    def plugged(cls) -> list[PluggedDevice]:
        """Adapters that may lead to an arm."""
        return serial_ports(cls.USB)

    def __init__(self, options: DynamixelOptions, scene: Scene | None, tick_period: float) -> None:  # noqa: ARG002
        if scene is not None:
            raise ValueError(f"scene: {NAME} is a real robot and touches what is in front of it; leave the scene out")
        self._options = options
        self._interpolation = Interpolation(options.lag_s)
        self.spec = self._spec()
        self._exchange = ArmExchange(options, self._connect, self._interpolation)
        super().__init__(
            NAME,
            self._exchange,
            rest=None,
            period=1.0 / options.rate_hz,
            on_command=False,
            stale=STALE_S,
            bad_replies=options.bad_replies,
            reconnect=options.reconnect_s,
        )
        self._stays = False
        self._reading: tuple[float, RobotReading] | None = None

    def _spec(self) -> RobotSpec:
        options = self._options
        error = worst_force_error(options)
        cutoff = LowPass(options.force_cutoff_hz)
        note = (
            "the force is estimated from motor currents, at rest within "
            f"{error[0]:.1f} N and {error[1]:.0%}, and lags {cutoff.lag * 1e3:.1f} ms more than the position"
        )
        advice = latency_advice(options.port) if options.port is not None else None
        return RobotSpec(
            name=NAME,
            axes="xyz",
            force_n=options.force_n,
            stiffness_n_m=options.stiffness_n_m,
            workspace_m=options.workspace_m,
            rate_hz=options.rate_hz,
            force_sensing=True,
            lag_s=options.lag_s,
            force_error=error,
            watchdog_s=registers.WATCHDOG_UNIT_S * watchdog_units(options.watchdog_s),
            note=note if advice is None else f"{note}; {advice}",
        )

    def _connect(self) -> SerialPort:
        path = self._options.port
        if path is None:
            path = only(self.plugged(), NAME, "slave.robot.port").path
        return SerialPort(path, self._options.baud)

    def open(self, now: float) -> None:
        self.close()
        self._exchange.hold_on_close = self._options.on_close is not OnClose.LIMP
        self._stays = False
        super().open(now)

    def command(self, position: Vector, now: float) -> None:
        if not is_finite(position):
            raise ValueError(f"{NAME}: commanded a position that is not finite: {position}")
        if self._is_open:
            self._worker.command(position, now)

    def latest(self, now: float) -> RobotReading:
        self._check()
        if self._reading is not None and now <= self._reading[0]:
            return self._reading[1]
        at, (x, y, z, fx, fy, fz) = self._interpolation.at(now)
        force, sampled_at = within((fx, fy, fz), self._options.force_n), self._interpolation.newest_at
        reading = RobotReading(min(at, now), (x, y, z), force, sampled_at=sampled_at)
        self._reading = (now, reading)
        return reading

    def stay(self) -> None:
        """Hold at `close`, instead of going home."""
        self._stays = True

    def close(self) -> None:
        """Leave the arm as `on_close` says; going home first takes at most 10 s."""
        if self._is_open and not self._stays and self._worker.fault is None and self._options.on_close is OnClose.REST:
            self._exchange.hold_on_close = not self._go_home()
        self._reading = None
        super().close()

    def _go_home(self) -> bool:
        """Whether the tip arrived."""
        home, speed = self._options.home_m, self._options.approach_m_s
        goal = self._worker.newest[0].tip
        until = monotonic() + REST_MOST_S
        while self._worker.fault is None and monotonic() < until:
            left = distance(goal, home)
            way = speed * REST_STEP_S
            goal = home if left <= way else add(goal, scale(subtract(home, goal), way / left))
            self._worker.command(goal, monotonic())
            sleep(REST_STEP_S)
            if goal == home and distance(self._worker.newest[0].tip, home) < REACHED_M:
                return True
        return False
