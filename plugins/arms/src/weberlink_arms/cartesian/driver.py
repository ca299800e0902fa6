"""The robot `dynamixel`: an OpenMANIPULATOR-X under Cartesian impedance, with its bus in a thread."""

from time import monotonic, sleep
from typing import Final

from weberlink.geometry.vector import Vector, add, distance, is_finite, scale, subtract, within
from weberlink.slave.robots.contract import RobotFault, RobotReading, RobotSpec
from weberlink.slave.scenes.scene import Scene
from weberlink_arms.cartesian.exchange import ArmExchange, TipSample
from weberlink_arms.cartesian.options import DynamixelOptions, OnClose, worst_force_error
from weberlink_arms.dynamixel.bus import USB
from weberlink_arms.servo.driver import BusDriver
from weberlink_arms.servo.position import LowPass

NAME: Final = "dynamixel"
STALE_S: Final = 0.1
REACHED_M: Final = 0.015
REST_STEP_S: Final = 0.01
REST_MOST_S: Final = 10.0


class DynamixelRobot(BusDriver[Vector | None, TipSample]):
    """An OpenMANIPULATOR-X at whose tip the environment is felt; ValueError if it is given a scene."""

    FAULT = RobotFault
    Options = DynamixelOptions
    USB = USB
    KEY = "slave.robot.port"

    def __init__(self, options: DynamixelOptions, scene: Scene | None, tick_period: float) -> None:  # noqa: ARG002
        if scene is not None:
            raise ValueError(f"scene: {NAME} is a real robot and touches what is in front of it; leave the scene out")
        self._options, self._arm, self._stays = options, ArmExchange(options, self.port(options, NAME)), False
        super().__init__(_spec(options), options, self._arm, rest=None, stale=STALE_S)

    def open(self, now: float) -> None:
        self.close()
        self._arm.hold_on_close = self._options.on_close is not OnClose.LIMP
        self._stays = False
        super().open(now)

    def command(self, position: Vector, now: float) -> None:
        if not is_finite(position):
            raise ValueError(f"{NAME}: commanded a position that is not finite: {position}")
        if self._is_open:
            self._worker.command(position, now)

    def _reading(self, at: float, values: tuple[float, ...], sampled_at: float) -> RobotReading:
        x, y, z, fx, fy, fz = values
        return RobotReading(at, (x, y, z), within((fx, fy, fz), self._options.force_n), sampled_at=sampled_at)

    def stay(self) -> None:
        """Hold at `close`, instead of going home."""
        self._stays = True

    def close(self) -> None:
        """Leave the arm as `on_close` says; going home first takes at most 10 s."""
        goes_home = self._is_open and not self._stays and self._options.on_close is OnClose.REST
        if goes_home and self._worker.fault is None:
            self._arm.hold_on_close = not self._go_home()
        super().close()

    def _go_home(self) -> bool:
        """Whether the tip arrived."""
        home, way = self._options.home_m, self._options.approach_m_s * REST_STEP_S
        goal = self._worker.newest[0].tip
        until = monotonic() + REST_MOST_S
        while self._worker.fault is None and monotonic() < until:
            left = distance(goal, home)
            goal = home if left <= way else add(goal, scale(subtract(home, goal), way / left))
            self._worker.command(goal, monotonic())
            sleep(REST_STEP_S)
            if goal == home and distance(self._worker.newest[0].tip, home) < REACHED_M:
                return True
        return False


def _spec(options: DynamixelOptions) -> RobotSpec:
    error, lag_ms = worst_force_error(options), 1e3 * LowPass(options.force_cutoff_hz).lag
    note = (
        f"the force is estimated from motor currents, at rest within {error[0]:.1f} N and {error[1]:.0%}, and lags "
        f"{lag_ms:.1f} ms more than the position"
    )
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
        watchdog_s=options.lets_go_s,
        note=options.note(note),
    )
