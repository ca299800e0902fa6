"""Drivers on a bus of servos: an exchange in a thread of its own, and readings interpolated between its cycles."""

from collections.abc import Callable
from typing import Any, ClassVar, Final, Generic, NamedTuple

from weberlink.hardware.discovery import PluggedDevice, UsbId, only, serial_ports
from weberlink.hardware.guardian import Guardian
from weberlink.hardware.serial_port import SerialPort
from weberlink.hardware.worker import Command, Exchange, Sample, ThreadedDriver
from weberlink.registry import Tier
from weberlink_arms.servo.options import BusOptions

KEPT: Final = 4  # samples: one more than the lag covers bridges a late one


class TimedValues(NamedTuple):
    """Measured at `at` [s]."""

    at: float
    values: tuple[float, ...]


class Interpolation:
    """Linear between neighbouring samples; held after the newest, and before the oldest of the `keep` that are kept.

    Values at `now` are those of `now - lag` [s]. With a lag of a sample period plus the transmission time, there is a
    sample on either side, so nothing is extrapolated. `add` may be called in one thread and `at` in another.
    """

    def __init__(self, lag: float, keep: int = KEPT) -> None:
        self._lag, self._keep = lag, keep
        # An immutable tuple, replaced as a whole: a reader in another thread sees the old one or the new one.
        self._samples: tuple[TimedValues, ...] = ()

    def restart(self, sample: TimedValues) -> None:
        """Forget everything but this one sample."""
        self._samples = (sample,)

    def add(self, sample: TimedValues) -> None:
        """Add a sample; one that is not newer than the last is ignored."""
        samples = self._samples
        if not samples or sample.at > samples[-1].at:
            self._samples = (*samples[1 - self._keep :], sample)

    @property
    def newest_at(self) -> float:
        """When the newest sample was measured [s]."""
        return self._samples[-1].at

    def at(self, now: float) -> TimedValues:
        """The values of `now - lag` with that time, held beyond either end; LookupError if there is no sample yet."""
        samples, moment = self._samples, now - self._lag
        later = samples[-1]
        if moment >= later.at:
            return later
        for earlier in samples[-2::-1]:
            if moment >= earlier.at:
                share = (moment - earlier.at) / (later.at - earlier.at)
                pairs = zip(earlier.values, later.values, strict=True)
                return TimedValues(moment, tuple([(1.0 - share) * a + share * b for a, b in pairs]))
            later = earlier
        return later


class _Recorded(Generic[Command, Sample]):
    """An exchange whose samples an interpolation receives."""

    def __init__(self, exchange: Exchange[Command, Sample], interpolation: Interpolation) -> None:
        self._exchange: Any = exchange  # its samples have `flat`, the values to interpolate
        self._interpolation = interpolation
        self.guardian = getattr(exchange, "guardian", None)
        self.close = exchange.close

    def open(self) -> Sample:
        sample: Any = self._exchange.open()
        self._interpolation.restart(sample.flat)
        return sample  # type: ignore[no-any-return]

    def exchange(self, command: Command) -> Sample:
        sample: Any = self._exchange.exchange(command)
        self._interpolation.add(sample.flat)
        return sample  # type: ignore[no-any-return]


class BusDriver(ThreadedDriver[Command, Sample]):
    """Readings are late by the lag of the spec, whose `rate_hz` is the rate of the bus.

    `rest` is the command that is safe at any time; one that is older than `stale` [s] no longer counts. `scale` gives a
    share of a command, 0 to 1, for the ramp after an interruption; None for no ramp.
    """

    TIER: ClassVar[Tier] = "emulated only"
    USB: ClassVar[tuple[UsbId, ...]]
    KEY: ClassVar[str]  # of the port, in a file

    @classmethod
    def plugged(cls) -> list[PluggedDevice]:
        """Adapters that may lead to an arm."""
        return serial_ports(cls.USB)

    @classmethod
    def port(cls, options: BusOptions, name: str, guardian: Guardian | None = None) -> Callable[[], SerialPort]:
        """Opens the port that the options name, or the only one."""
        return lambda: SerialPort(options.port or only(cls.plugged(), name, cls.KEY).path, options.baud, guardian)

    def __init__(
        self,
        spec: Any,
        options: BusOptions,
        exchange: Exchange[Command, Sample],
        *,
        rest: Command,
        stale: float,
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
            bad_replies=options.bad_replies,
            reconnect=options.reconnect_s,
            scale=scale,
        )

    def _reading(self, at: float, values: tuple[float, ...], sampled_at: float) -> Any:
        """A reading of interpolated values."""
        raise NotImplementedError

    def _measured(self, now: float) -> Any:
        at, values = self._interpolation.at(now)
        return self._reading(min(at, now), values, self._interpolation.newest_at)
