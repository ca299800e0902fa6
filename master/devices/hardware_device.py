"""What drivers of hardware share: options, the check of signs without which a device has no force, and the thread."""

from collections.abc import Callable
from hashlib import sha256
from typing import Annotated, Any

from pydantic import Field

from weberlink.geometry.vector import ZERO, Vector, scale, within
from weberlink.hardware.worker import Exchange, ThreadedDriver
from weberlink.master.devices.contract import DeviceFault, DeviceReading, DeviceSpec, check_finite
from weberlink.options import Options

STALE_S = 0.01  # a force ends this long, or three ticks, after the last command [s]
RAMP_S = 0.05  # duration of the force ramp after an interruption (connection, bad reply, missing commands) [s]
Stiffness = Annotated[float, Field(ge=1e-3, le=1e9)]  # of the stiffest wall that a device displays [N/m]
Reply = Annotated[float, Field(ge=1.0, le=100.0, description="how long an answer may take")]  # [ms]


class HardwareOptions(Options):
    """Options of a device that is looked for when it is gone."""

    reconnect_s: float = Field(default=0.0, ge=0.0, le=60.0, description="how long to look for it when it is gone")


class PortOptions(HardwareOptions):
    """Options of a device that has a path here."""

    port: str | None = Field(default=None, description="path of the device; the only one plugged in if not given")


class ForceOptions(Options):
    """The option of a device with force feedback that its driver's `fingerprint` is compared with."""

    signs_checked: Annotated[str, Field(pattern="^[0-9a-f]{8}$")] | None = Field(
        default=None, description="what `weberlink device test` prints once the directions are right; no force without"
    )


def limited_force(asked: float | None, published: float, model: str) -> float:
    """The largest force [N]: as asked, or what is published of the model; raises ValueError for more than that."""
    if asked is not None and asked > published:
        raise ValueError(f"force_n: expected at most {published:g} N for {model}, got {asked:g}")
    return published if asked is None else asked


def force_spec(
    name: str,
    options: ForceOptions,
    signs: str | None,
    *,
    force_n: float,
    torque_n_m: float = 0.0,
    note: str = "",
    reminder: str = "",
    **others: Any,
) -> DeviceSpec:
    """The spec of a device that has force, and torque, only with checked signs; its limits are those with checked ones.

    `signs` is the fingerprint of all settings that turn an axis; None where they do not say which device it is. `note`
    is for a device with force, `reminder` for any.
    """
    armed = signs is not None and options.signs_checked == signs
    if signs is None:
        note = "no force: the file does not say which device it is; set master.device.model"
    elif not armed:
        stale = "" if options.signs_checked is None else " with these settings"
        note = f"no force: signs not checked{stale}; run: weberlink device test {name}"
    return DeviceSpec(
        name=name,
        force_n=force_n if armed else 0.0,
        torque_n_m=torque_n_m if armed else 0.0,
        force_feedback=armed,
        note="; ".join(filter(None, (note, reminder))),
        **others,
    )


def fingerprint(settings: str) -> str:
    """Eight hexadecimal digits for a text of settings.

    The first is a letter, so that a YAML file takes it for a text and not for a number.
    """
    digest = sha256(settings.encode()).digest()
    return f"{digest[0] | 0xA0:02x}{digest[1:4].hex()}"


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

    @property
    def round_trip_s(self) -> float:
        """Time that the last exchange took [s]."""
        return self._worker.round_trip

    def command(self, force: Vector, now: float) -> None:
        self._worker.command(self._displayable(force), now)

    def _displayable(self, force: Vector) -> Vector:
        """The force along the axes of the device, cut to its limit; raises ValueError for one that is not finite."""
        check_finite(self.spec.name, "force", force)
        x, y, z = self._mask
        return within((x * force[0], y * force[1], z * force[2]), self.spec.force_n)
