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

from pydantic import BaseModel, ConfigDict, Field, model_validator

from weberlink.geometry.rotation import IDENTITY, Quaternion, product, quaternion, unit_quaternion
from weberlink.geometry.vector import ZERO, Vector, check_home, is_finite
from weberlink.hardware.fault import HardwareFault
from weberlink.hardware.worker import Exchange, Worker
from weberlink.master.devices.contract import DeviceFault, DeviceReading, DeviceSpec
from weberlink.master.devices.threaded_device import STALE_S, SessionExchange

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


class RateOptions(BaseModel):
    """Options of every rate-controlled device."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    port: str | None = Field(default=None, description="path of the device; the only one plugged in if not given")
    reconnect_s: float = Field(default=0.0, ge=0.0, le=60.0, description="how long to look for it when it is gone")
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


class RateControl:
    """The commanded position, which follows the law of this module and stays within the workspace.

    Args:
        options: speed, push, dead zone, workspace and home.
    """

    def __init__(self, options: RateOptions) -> None:
        self._options = options
        self.position = options.home_m
        """[m]"""

    def advance(self, deflection: Vector, force: Vector, step: float) -> Vector:
        """Move on by `step` [s] under the force on the hand [N]; gives the position."""
        options = self._options
        speed, push, edge = options.speed_m_s, options.push_n, options.workspace_m
        d = beyond_dead_zone(deflection, options.dead_zone)
        x, y, z = d[0] + force[0] / push, d[1] + force[1] / push, d[2] + force[2] / push
        way = speed * step / max(1.0, hypot(x, y, z))
        at = self.position
        self.position = (
            min(max(at[0] + way * x, -edge), edge),
            min(max(at[1] + way * y, -edge), edge),
            min(max(at[2] + way * z, -edge), edge),
        )
        return self.position


class RateDevice:
    """A `Device` whose deflection moves a position; times are of `time.monotonic` [s].

    The exchange takes the force on the hand [N], for a device that can show it somehow, and gives a `Deflection`.

    Args:
        name: of the driver.
        options: of the driver.
        exchange: with the device, each of at most about `WAIT_S`.
        tick_period: [s].
        buttons: number of buttons.
        spin: rate of turning at full deflection [rad/s]; None for a device without orientation.
        note: what a person should know before a run.
    """

    def __init__(
        self,
        name: str,
        options: RateOptions,
        exchange: Exchange[Vector, Deflection],
        tick_period: float,
        *,
        buttons: int,
        spin: float | None = None,
        note: str = "",
    ) -> None:
        edge = options.workspace_m
        self.spec = DeviceSpec(
            name=name,
            axes="xyz",
            force_n=0.0,
            stiffness_n_m=options.push_n / options.speed_m_s / (e * max(LOOP_S, tick_period)),
            workspace_m=((-edge, -edge, -edge), (edge, edge, edge)),
            rate_hz=1.0 / tick_period,
            force_feedback=False,
            buttons=buttons,
            orientation=spin is not None,
            watchdog_s=0.0,
            note=note,
            push_n=options.push_n,
        )
        self._options = options
        self._exchange = exchange
        self._worker = Worker(
            exchange,
            rest=ZERO,
            period=PERIOD_S,
            on_command=False,
            stale=max(STALE_S, LONGEST_TICKS * tick_period),
            bad_replies=1,
            reconnect=options.reconnect_s,
        )
        self._longest_step = max(LONGEST_STEP, LONGEST_TICKS * tick_period)
        self._spin = spin
        self._control = RateControl(options)
        self._orientation: Quaternion = IDENTITY
        self._felt = ZERO
        self._reading: DeviceReading | None = None
        self._asked_at = 0.0

    @property
    def trouble(self) -> str | None:
        return self._worker.trouble

    def open(self, now: float) -> None:
        self.close()
        if isinstance(self._exchange, SessionExchange):
            self._exchange.start_afresh()
        try:
            self._worker.start()
        except HardwareFault as fault:
            raise self._fault(str(fault)) from None
        self._control = RateControl(self._options)
        self._orientation = IDENTITY
        buttons = self._worker.newest[0].buttons
        self._reading, self._asked_at = self._reading_at(now, buttons), now

    def latest(self, now: float) -> DeviceReading:
        reading = self._reading
        if reading is None:
            raise self._fault("not open")
        self._worker.check(self._fault)
        if now <= self._asked_at:
            return reading
        self._asked_at = now
        deflection, seen_at = self._worker.newest
        until = min(now, seen_at + LIVE_S)
        if until > reading.at:
            self._advance(deflection, min(until - reading.at, self._longest_step))
            self._reading = reading = self._reading_at(until, deflection.buttons)
        return reading

    def command(self, force: Vector, now: float) -> None:
        if not is_finite(force):
            raise ValueError(f"{self.spec.name}: commanded a force that is not finite: {force}")
        if self._reading is not None:
            self._felt = force
            self._worker.command(force, now)

    def close(self) -> None:
        self._reading = None
        self._felt = ZERO
        self._worker.stop()

    def _advance(self, deflection: Deflection, step: float) -> None:
        self._control.advance(deflection.move, self._felt, step)
        if self._spin is not None:
            turn = beyond_dead_zone(deflection.turn, self._options.dead_zone)
            if turn != ZERO:
                angle = self._spin * step
                turned = product(quaternion((angle * turn[0], angle * turn[1], angle * turn[2])), self._orientation)
                self._orientation = unit_quaternion(turned) or IDENTITY

    def _reading_at(self, at: float, buttons: int) -> DeviceReading:
        orientation = None if self._spin is None else self._orientation
        return DeviceReading(at, self._control.position, False, orientation, buttons)

    def _fault(self, why: str) -> DeviceFault:
        name = f"{self.spec.name}: "
        return DeviceFault(name + why.removeprefix(name))
