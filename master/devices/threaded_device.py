"""A blocking device behind the non-blocking `Device` contract: its exchange runs in a thread."""

from collections.abc import Callable
from hashlib import sha256
from typing import Any

from weberlink.geometry.vector import ZERO, Vector, scale, within
from weberlink.hardware.worker import Exchange, ThreadedDriver
from weberlink.master.devices.contract import DeviceFault, DeviceReading, DeviceSpec, check_finite

STALE_S = 0.01  # a force ends this long, or three ticks, after the last command [s]
RAMP_S = 0.05  # duration of the force ramp after an interruption (connection, bad reply, missing commands) [s]


class ThreadedDevice(ThreadedDriver[Any, DeviceReading]):
    """A device of which each exchange takes a command, a force [N] along its axes, and gives a reading.

    A command starts an exchange at once. Without commands the exchange continues with `rest`, which displays nothing
    and feeds the device's own watchdog. After every interruption commands ramp up from zero over `RAMP_S`; `share`
    gives a share of one, 0 to 1. The exchange gets commands within the limits of `spec`. `bad_replies` in a row end the
    session; nothing is displayed from the first. A device that is gone is looked for during `reconnect` [s].
    """

    FAULT = DeviceFault

    def __init__(
        self,
        spec: DeviceSpec,
        exchange: Exchange[Any, DeviceReading],
        tick_period: float,
        *,
        bad_replies: int = 10,
        reconnect: float = 0.0,
        rest: Any = ZERO,
        share: Callable[[Any, float], Any] = scale,
    ) -> None:
        self.spec = spec
        self._stale = max(STALE_S, 3.0 * tick_period)
        super().__init__(
            spec.name,
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

    def command(self, force: Vector, now: float) -> None:
        self._worker.command(self._displayable(force), now)

    def close(self) -> None:
        self._answer = None
        super().close()

    def _displayable(self, force: Vector) -> Vector:
        """The force along the axes of the device, cut to its limit; raises ValueError for one that is not finite."""
        check_finite(self.spec.name, "force", force)
        x, y, z = self._mask
        return within((x * force[0], y * force[1], z * force[2]), self.spec.force_n)


def fingerprint(settings: str) -> str:
    """Eight hexadecimal digits for a text of settings.

    The first is a letter, so that a YAML file takes it for a text and not for a number.
    """
    digest = sha256(settings.encode()).digest()
    return f"{digest[0] | 0xA0:02x}{digest[1:4].hex()}"
