"""Rate control: a deflection is a velocity, and the felt force resists it. For devices that come back to the middle.

The commanded position moves with

    v = speed d + force / b,    b = push / speed,    |v| <= speed

with the deflection d (length 0 to 1 beyond the dead zone), the force on the hand and the damping b [N s/m]. This is an
admittance: pressed with d against anything, the position stops where the force is `push` |d|. So a full deflection
holds `push` at most, half a deflection half of it, and a released device gives way until no force is left.

A wall of stiffness K answers with the time constant b / K; its force is stable while the delay of the whole loop is
below pi/2 of that, and does not oscillate below 1/e of it. More `push` or less `speed` makes b larger.
"""

from math import e, hypot
from typing import NamedTuple, Self

from pydantic import Field, model_validator

from weberlink.geometry.rotation import IDENTITY, product, quaternion, unit_quaternion
from weberlink.geometry.vector import ZERO, Vector, check_home, cube, scale
from weberlink.hardware.worker import Exchange, ThreadedDriver
from weberlink.master.devices.contract import DeviceFault, DeviceReading, DeviceSpec, check_finite
from weberlink.master.devices.hardware_device import STALE_S, PortOptions

PERIOD_S = 0.001
"""Least time between two looks at the device [s]."""
WAIT_S = 0.004
"""Longest wait for a report in one exchange [s]."""
LIVE_S = 0.02
"""Without a finished exchange for this long [s], time stands still: the loop then notices that readings are old."""
LOOP_S = 0.005
"""Delay from a position to its force [s] up to which the stated stiffness does not oscillate; a local link has less."""
LONGEST_STEP, LONGEST_TICKS = 0.01, 3
"""A gap between two readings that is longer than both, in seconds and in ticks, makes the position pause; it does not
jump."""


class RateOptions(PortOptions):
    """Options of every rate-controlled device."""

    speed_m_s: float = Field(default=0.08, gt=0.0, le=1.0, description="at full deflection in free space; the limit")
    push_n: float = Field(default=3.0, gt=0.0, le=1e3, description="force that a full deflection holds against a wall")
    dead_zone: float = Field(default=0.1, ge=0.0, lt=1.0, description="share of the deflection that is ignored")
    workspace_m: float = Field(default=0.06, ge=1e-3, le=10.0, description="half an edge of the cube of positions")
    home_m: Vector = Field(default=(0.0, 0.0, 0.03), description="position at the start of a session")

    @model_validator(mode="after")
    def check_home(self) -> Self:
        check_home(self.home_m, self.workspace_m)
        return self


class Deflection(NamedTuple):
    """What a device was last seen to do: components of -1 to 1, x toward the operator, y to the right, z up.

    `turn` is a rotation vector about the same axes, 1 for a full deflection; `buttons` has a bit for each one pressed.
    """

    move: Vector = ZERO
    turn: Vector = ZERO
    buttons: int = 0


def beyond_dead_zone(deflection: Vector, dead_zone: float) -> Vector:
    """The deflection in its own direction, 0 at the edge of the dead zone and at most 1 long."""
    x, y, z = deflection
    length = hypot(x, y, z)
    if length <= dead_zone or length == 0.0:
        return ZERO
    share = min(1.0, (length - dead_zone) / (1.0 - dead_zone)) / length
    return (share * x, share * y, share * z)


def moved(at: Vector, deflection: Vector, force: Vector, step: float, options: RateOptions) -> Vector:
    """Where the law of this module moves a position [m] in `step` [s] under the force on the hand [N]."""
    push, edge = options.push_n, options.workspace_m
    d = beyond_dead_zone(deflection, options.dead_zone)
    x, y, z = d[0] + force[0] / push, d[1] + force[1] / push, d[2] + force[2] / push
    way = options.speed_m_s * step / max(1.0, hypot(x, y, z))
    x, y, z = (min(max(start + way * part, -edge), edge) for start, part in zip(at, (x, y, z), strict=True))
    return (x, y, z)


class RateDevice(ThreadedDriver[Vector, Deflection]):
    """A device whose deflection moves a position.

    The exchange takes the force on the hand [N], for a device that can show it somehow; each is of at most `WAIT_S` or
    so.

    Args:
        name: of the driver.
        options: of the driver.
        exchange: with the device.
        tick_period: [s].
        buttons: number of buttons.
        spin: rate of turning at full deflection [rad/s]; None for a device without orientation.
    """

    FAULT = DeviceFault

    def __init__(
        self,
        name: str,
        options: RateOptions,
        exchange: Exchange[Vector, Deflection],
        tick_period: float,
        *,
        buttons: int,
        spin: float | None = None,
    ) -> None:
        self.spec = DeviceSpec(
            name=name,
            axes="xyz",
            force_n=0.0,
            stiffness_n_m=options.push_n / options.speed_m_s / (e * max(LOOP_S, tick_period)),
            workspace_m=cube(options.workspace_m),
            rate_hz=1.0 / tick_period,
            force_feedback=False,
            buttons=buttons,
            orientation=spin is not None,
            watchdog_s=0.0,
            push_n=options.push_n,
        )
        super().__init__(
            name,
            exchange,
            rest=ZERO,
            period=PERIOD_S,
            on_command=False,
            stale=max(STALE_S, LONGEST_TICKS * tick_period),
            bad_replies=1,
            reconnect=options.reconnect_s,
        )
        self._options = options
        self._longest_step = max(LONGEST_STEP, LONGEST_TICKS * tick_period)
        self._spin = spin
        self._begin(0.0, 0)

    def _begin(self, now: float, buttons: int) -> None:
        self._position, self._orientation = self._options.home_m, IDENTITY
        self._felt = ZERO
        self._reading = self._reading_at(now, buttons)

    def open(self, now: float) -> None:
        super().open(now)
        self._begin(now, self._worker.newest[0].buttons)

    def _measured(self, now: float) -> DeviceReading:
        deflection, seen_at = self._worker.newest
        until, at = min(now, seen_at + LIVE_S), self._reading.at
        if until > at:
            self._advance(deflection, min(until - at, self._longest_step))
            self._reading = self._reading_at(until, deflection.buttons)
        return self._reading

    def command(self, force: Vector, now: float) -> None:
        check_finite(self.spec.name, "force", force)
        if self._is_open:
            self._felt = force
            self._worker.command(force, now)

    def _advance(self, deflection: Deflection, step: float) -> None:
        self._position = moved(self._position, deflection.move, self._felt, step, self._options)
        turn = beyond_dead_zone(deflection.turn, self._options.dead_zone)
        if self._spin is not None and turn != ZERO:
            turned = product(quaternion(scale(turn, self._spin * step)), self._orientation)
            self._orientation = unit_quaternion(turned) or IDENTITY

    def _reading_at(self, at: float, buttons: int) -> DeviceReading:
        orientation = None if self._spin is None else self._orientation
        return DeviceReading(at, self._position, False, orientation, buttons)
