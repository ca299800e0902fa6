"""The drivers of arms with servos, whatever the servos are."""

from collections.abc import Callable
from time import monotonic, sleep
from typing import Any, ClassVar, Final, TypeVar

from weberlink.arms.contract import ArmSpec
from weberlink.geometry.joints import Joints
from weberlink.hardware.discovery import PluggedDevice, UsbId, only, serial_ports
from weberlink.hardware.guardian import Guardian
from weberlink.hardware.serial_port import SerialPort
from weberlink.hardware.worker import Exchange
from weberlink.registry import Tier
from weberlink_arms.servo.exchange import PositionControl
from weberlink_arms.servo.on_close import SINK_S, OnClose
from weberlink_arms.servo.options import ServoOptions
from weberlink_arms.servo.threaded_arm import ArmSample, ThreadedArm

LEADER_STALE_S: Final = 0.02
FOLLOWER_STALE_S: Final = 0.1
"""A command ends this long, or three ticks, after it was given; a follower holds its last goal then [s]."""
LOOK_S: Final = 0.02
"""Between two looks at an arm that sinks [s]."""

Command = TypeVar("Command")


class ServoArm(ThreadedArm[Command]):
    """An arm on a bus."""

    TIER: ClassVar[Tier] = "emulated only"
    USB: ClassVar[tuple[UsbId, ...]]
    KEY: ClassVar[str]
    """Of the port, in a file."""

    @classmethod
    def plugged(cls) -> list[PluggedDevice]:
        """Adapters that may lead to an arm."""
        return serial_ports(cls.USB)

    @classmethod
    def port(cls, options: ServoOptions, guardian: Guardian | None = None) -> Callable[[], SerialPort]:
        """Opens the port that the options name, or the only one."""

        def connect() -> SerialPort:
            path = options.port or only(cls.plugged(), options.LAYOUT.name, cls.KEY).path
            return SerialPort(path, options.baud, guardian)

        return connect


class ServoLeader(ServoArm[Joints]):
    """A leader that displays torques, at most those of its spec."""

    KEY = "master.device.port"

    def __init__(
        self, options: ServoOptions, spec: ArmSpec, exchange: Exchange[Joints, ArmSample], tick_period: float
    ) -> None:
        super().__init__(
            spec,
            exchange,
            rest=(0.0,) * spec.axes,
            stale=max(LEADER_STALE_S, 3.0 * tick_period),
            bad_replies=options.bad_replies,
            reconnect=options.reconnect_s,
            scale=lambda torques, share: tuple([share * each for each in torques]),
        )

    def command(self, values: Joints, now: float) -> None:
        limits = zip(values, self.spec.torque_nm, strict=False)
        self._command(tuple([min(max(torque, -most), most) for torque, most in limits]), values, now)


class ServoFollower(ServoArm[Joints | None]):
    """A follower under the position control of its servos."""

    KEY = "slave.robot.port"

    def __init__(self, options: Any, spec: ArmSpec, exchange: Any, tick_period: float) -> None:
        super().__init__(
            spec,
            exchange,
            rest=None,
            stale=max(FOLLOWER_STALE_S, 3.0 * tick_period),
            bad_replies=options.bad_replies,
            reconnect=options.reconnect_s,
        )
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
