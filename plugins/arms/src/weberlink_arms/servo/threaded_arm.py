"""An arm on a blocking bus behind the non-blocking `Arm` contract: its exchange runs in a thread of its own."""

from collections.abc import Callable
from typing import Generic, NamedTuple

from weberlink.arms.contract import ArmFault, ArmReading, ArmSpec
from weberlink.geometry.joints import Joints, is_finite
from weberlink.hardware.worker import Command, Exchange, ThreadedDriver
from weberlink_arms.interpolation import Interpolation, TimedValues


class ArmSample(NamedTuple):
    """Measured at `at` [s]: angles [rad] and torques of the environment [N m] of all axes."""

    at: float
    angles: Joints
    torques: Joints

    @property
    def flat(self) -> TimedValues:
        return TimedValues(self.at, self.angles + self.torques)


class ThreadedArm(ThreadedDriver[Command, ArmSample]):
    """Readings are interpolated between the cycles of the bus, late by the lag of the spec.

    Args:
        spec: Of the arm; its `rate_hz` is the rate of the bus.
        exchange: Takes a command, and gives a sample.
        rest: The command that is safe at any time.
        stale: Age beyond which a command no longer counts [s].
        bad_replies: How many in a row end the session.
        reconnect: How long to look for the arm when it is gone [s].
        scale: Gives a share of a command, 0 to 1, for the ramp after an interruption; None for no ramp.
    """

    FAULT = ArmFault

    def __init__(
        self,
        spec: ArmSpec,
        exchange: Exchange[Command, ArmSample],
        *,
        rest: Command,
        stale: float,
        bad_replies: int,
        reconnect: float,
        scale: Callable[[Command, float], Command] | None = None,
    ) -> None:
        self.spec = spec
        self._interpolation = Interpolation(spec.lag_s)
        super().__init__(
            spec.name,
            _Recorded(exchange, self._interpolation),
            rest=rest,
            period=1.0 / spec.rate_hz,
            on_command=False,
            stale=stale,
            bad_replies=bad_replies,
            reconnect=reconnect,
            scale=scale,
        )
        self._answer: tuple[float, ArmReading] | None = None

    def latest(self, now: float) -> ArmReading:
        self._check()
        if self._answer is None or now > self._answer[0]:
            at, values = self._interpolation.at(now)
            axes = self.spec.axes
            newest = self._interpolation.newest_at
            self._answer = (now, ArmReading(min(at, now), values[:axes], values[axes:], sampled_at=newest))
        return self._answer[1]

    def _command(self, command: Command, values: Joints, now: float) -> None:
        """Set the command of these values; raises ValueError for one that is not finite or not of this arm."""
        if len(values) != self.spec.axes or not is_finite(values):
            raise ValueError(f"{self.spec.name}: expected {self.spec.axes} finite values, got {values}")
        if self._is_open:
            self._worker.command(command, now)

    def close(self) -> None:
        self._answer = None
        super().close()


class _Recorded(Generic[Command]):
    """An exchange whose samples an interpolation receives."""

    def __init__(self, exchange: Exchange[Command, ArmSample], interpolation: Interpolation) -> None:
        self._exchange = exchange
        self._interpolation = interpolation
        self.guardian = getattr(exchange, "guardian", None)
        self.close = exchange.close

    def open(self) -> ArmSample:
        sample = self._exchange.open()
        self._interpolation.restart(sample.flat)
        return sample

    def exchange(self, command: Command) -> ArmSample:
        sample = self._exchange.exchange(command)
        self._interpolation.add(sample.flat)
        return sample
