"""The drivers of arms with servos, whatever the servos are."""

from time import monotonic, sleep
from typing import Any, Final, NamedTuple

from weberlink.arms.contract import ArmFault, ArmReading, ArmSpec
from weberlink.geometry.joints import Joints, is_finite
from weberlink.hardware.worker import Command, Exchange
from weberlink_arms.servo.driver import BusDriver, TimedValues
from weberlink_arms.servo.options import ServoOptions
from weberlink_arms.servo.position import SINK_S, OnClose, PositionControl

# A command ends this long, or three ticks, after it was given; a follower holds its last goal then [s].
LEADER_STALE_S: Final = 0.02
FOLLOWER_STALE_S: Final = 0.1
LOOK_S: Final = 0.02  # between two looks at an arm that sinks


class ArmSample(NamedTuple):
    """Measured at `at` [s]: angles [rad] and torques of the environment [N m] of all axes."""

    at: float
    angles: Joints
    torques: Joints

    @property
    def flat(self) -> TimedValues:
        return TimedValues(self.at, self.angles + self.torques)


class ServoArm(BusDriver[Command, ArmSample]):
    """An arm on a bus."""

    FAULT = ArmFault

    def _reading(self, at: float, values: tuple[float, ...], sampled_at: float) -> ArmReading:
        axes = self.spec.axes
        return ArmReading(at, values[:axes], values[axes:], sampled_at=sampled_at)

    def _command(self, command: Command, values: Joints, now: float) -> None:
        """Set the command of these values; raises ValueError for one that is not finite or not of this arm."""
        if len(values) != self.spec.axes or not is_finite(values):
            raise ValueError(f"{self.spec.name}: expected {self.spec.axes} finite values, got {values}")
        if self._is_open:
            self._worker.command(command, now)


class ServoLeader(ServoArm[Joints]):
    """A leader that displays torques, at most those of its spec."""

    KEY = "master.device.port"

    def __init__(
        self, options: ServoOptions, spec: ArmSpec, exchange: Exchange[Joints, ArmSample], tick_period: float
    ) -> None:
        super().__init__(
            spec,
            options,
            exchange,
            rest=(0.0,) * spec.axes,
            stale=max(LEADER_STALE_S, 3.0 * tick_period),
            scale=lambda torques, share: tuple([share * each for each in torques]),
        )

    def command(self, values: Joints, now: float) -> None:
        limits = zip(values, self.spec.torque_nm, strict=False)
        self._command(tuple([min(max(torque, -most), most) for torque, most in limits]), values, now)


class ServoFollower(ServoArm[Joints | None]):
    """A follower under the position control of its servos."""

    KEY = "slave.robot.port"

    def __init__(self, options: Any, spec: ArmSpec, exchange: Any, tick_period: float) -> None:
        super().__init__(spec, options, exchange, rest=None, stale=max(FOLLOWER_STALE_S, 3.0 * tick_period))
        self._control: PositionControl = exchange.control
        self._sinks = options.on_close is OnClose.SINK

    def command(self, values: Joints, now: float) -> None:
        self._command(values, values, now)

    def stay(self) -> None:
        """Hold at `close`, instead of sinking."""
        self._sinks = False

    def close(self) -> None:
        """Leave the arm as `on_close` says; to sink takes `SINK_S` at most."""
        if self._is_open and self._sinks:
            self._control.sinks = True
            until = monotonic() + SINK_S
            while not self._control.lies and self._worker.fault is None and monotonic() < until:
                sleep(LOOK_S)
        super().close()


def spec_of(options: ServoOptions, **more: Any) -> ArmSpec:
    """What the options say, and more."""
    layout = options.LAYOUT
    return ArmSpec(
        name=layout.name,
        joints=layout.joints,
        gripper=True,
        lower=options.lower,
        upper=options.upper,
        rate_hz=options.rate_hz,
        lag_s=options.lag_s,
        **more,
    )
