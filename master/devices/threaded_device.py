"""A blocking device behind the non-blocking `Device` contract: its exchange runs in a thread."""

from collections.abc import Callable
from hashlib import sha256
from math import inf
from typing import Generic, NamedTuple, Protocol, TypeVar, runtime_checkable

from weberlink.geometry.vector import ZERO, Vector, is_finite, scale, within
from weberlink.hardware.fault import HardwareFault
from weberlink.hardware.worker import Exchange, Worker
from weberlink.master.devices.contract import DeviceFault, DeviceReading, DeviceSpec

STALE_S = 0.01
"""A force ends this long, or three ticks, after the last command [s]."""
RAMP_S = 0.05
"""Duration of the force ramp after an interruption (connection, bad reply, missing commands) [s]."""

Command = TypeVar("Command")
Sample = TypeVar("Sample")


class Wrench(NamedTuple):
    """Force [N] and torque [N m] on the hand."""

    force: Vector = ZERO
    torque: Vector = ZERO

    def scaled(self, factor: float) -> "Wrench":
        return Wrench(scale(self.force, factor), scale(self.torque, factor))


NO_WRENCH = Wrench()


@runtime_checkable
class SessionExchange(Protocol):
    """An exchange with state that lasts over reconnections, but not over sessions."""

    def start_afresh(self) -> None:
        """Forget the last session; called before the first `open` of the next one."""
        ...


class WorkedDevice(Generic[Command, Sample]):
    """A device whose exchange a `Worker` runs; times are of `time.monotonic` [s]. A subclass makes readings of samples.

    Args:
        spec: of the device.
        exchange: see `weberlink.hardware.worker.Exchange` for its exceptions.
        worker: of the exchange.
    """

    def __init__(self, spec: DeviceSpec, exchange: Exchange[Command, Sample], worker: Worker[Command, Sample]) -> None:
        self.spec = spec
        self._exchange = exchange
        self._worker = worker
        self._is_open = False

    @property
    def guarded(self) -> bool:
        """Whether a guardian process takes the force off when this process stops."""
        return self._worker.guarded

    @property
    def trouble(self) -> str | None:
        return self._worker.trouble

    def open(self, now: float) -> None:  # noqa: ARG002
        self.close()
        if isinstance(self._exchange, SessionExchange):
            self._exchange.start_afresh()
        try:
            self._worker.start()
        except HardwareFault as fault:
            raise self._fault(str(fault)) from None
        self._is_open = True

    def close(self) -> None:
        self._is_open = False
        self._worker.stop()

    def _check(self) -> None:
        """Raise DeviceFault for a device that is not open, or that cannot go on."""
        if not self._is_open:
            raise self._fault("not open")
        self._worker.check(self._fault)

    def _check_finite(self, vector: Vector, what: str) -> None:
        if not is_finite(vector):
            raise ValueError(f"{self.spec.name}: commanded a {what} that is not finite: {vector}")

    def _fault(self, why: str) -> DeviceFault:
        """The fault with the driver's name in front, once."""
        name = f"{self.spec.name}: "
        return DeviceFault(name + why.removeprefix(name))


class BlockingDevice(WorkedDevice[Command, DeviceReading]):
    """A device of which each exchange gives a reading; a subclass makes commands of what is to be displayed.

    A command starts an exchange at once. Without commands the exchange continues with `rest`, which feeds the
    device's own watchdog. After every interruption commands ramp up from zero over `RAMP_S`.

    Args:
        spec: of the device.
        exchange: takes a command within the limits of the spec, and gives a reading.
        tick_period: [s].
        rest: the command that displays nothing.
        share: gives a share of a command, 0 to 1.
        bad_replies: number in a row that ends the session; nothing is displayed from the first.
        reconnect: how long to look for the device when it is gone [s].
    """

    def __init__(
        self,
        spec: DeviceSpec,
        exchange: Exchange[Command, DeviceReading],
        tick_period: float,
        *,
        rest: Command,
        share: Callable[[Command, float], Command],
        bad_replies: int = 10,
        reconnect: float = 0.0,
    ) -> None:
        self._stale = max(STALE_S, 3.0 * tick_period)
        worker = Worker(
            exchange,
            rest=rest,
            period=2.0 * tick_period,  # else the pause could end just before the command comes
            on_command=True,
            stale=self._stale,
            bad_replies=bad_replies,
            reconnect=reconnect,
            scale=share,
            ramp=RAMP_S,
        )
        super().__init__(spec, exchange, worker)
        x, y, z = (float(axis in spec.axes) for axis in "xyz")
        self._mask: Vector = (x, y, z)
        self._answer: tuple[float, DeviceReading] | None = None

    @property
    def round_trip_s(self) -> float:
        """Time that the last exchange took [s]."""
        return self._worker.round_trip

    def latest(self, now: float) -> DeviceReading:
        self._check()
        if self._answer is None or self._answer[0] != now:
            self._answer = (now, self._worker.newest[0])
        return self._answer[1]

    def close(self) -> None:
        self._answer = None
        super().close()

    def _displayable(self, force: Vector) -> Vector:
        """The force along the axes of the device, cut to its limit; raises ValueError for one that is not finite."""
        self._check_finite(force, "force")
        x, y, z = self._mask
        return within((x * force[0], y * force[1], z * force[2]), self.spec.force_n)


class ThreadedDevice(BlockingDevice[Vector]):
    """A device that displays force alone: its exchange takes a force [N] along the axes.

    For the arguments see `BlockingDevice`.
    """

    def __init__(
        self,
        spec: DeviceSpec,
        exchange: Exchange[Vector, DeviceReading],
        tick_period: float,
        *,
        bad_replies: int = 10,
        reconnect: float = 0.0,
    ) -> None:
        super().__init__(
            spec, exchange, tick_period, rest=ZERO, share=scale, bad_replies=bad_replies, reconnect=reconnect
        )

    def command(self, force: Vector, now: float) -> None:
        self._worker.command(self._displayable(force), now)


class ThreadedTorqueDevice(BlockingDevice[Wrench]):
    """A device that displays force and torque, as one command; see `BlockingDevice` for the arguments.

    `command` starts the exchange, with the torque of the last `turn`: a loop that turns after it commands is one tick
    late with the torque. A torque ends as a force does when no new one comes.
    """

    def __init__(
        self,
        spec: DeviceSpec,
        exchange: Exchange[Wrench, DeviceReading],
        tick_period: float,
        *,
        bad_replies: int = 10,
        reconnect: float = 0.0,
    ) -> None:
        super().__init__(
            spec,
            exchange,
            tick_period,
            rest=NO_WRENCH,
            share=Wrench.scaled,
            bad_replies=bad_replies,
            reconnect=reconnect,
        )
        self._torque: tuple[Vector, float] = (ZERO, -inf)
        """The last one, and its time."""

    def open(self, now: float) -> None:
        self._torque = (ZERO, -inf)
        super().open(now)

    def command(self, force: Vector, now: float) -> None:
        torque, at = self._torque
        self._worker.command(Wrench(self._displayable(force), torque if now - at <= self._stale else ZERO), now)

    def turn(self, torque: Vector, now: float) -> None:
        self._check_finite(torque, "torque")
        self._torque = (within(torque, self.spec.torque_n_m), now)


def fingerprint(settings: str) -> str:
    """Eight hexadecimal digits for a text of settings.

    The first is a letter, so that a YAML file takes it for a text and not for a number.
    """
    digest = sha256(settings.encode()).digest()
    return f"{digest[0] | 0xA0:02x}{digest[1:4].hex()}"
