"""A modelled hand on a handle, moved by an intention, and intentions: legs of minimum jerk or as recorded."""

from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import accumulate
from math import cos, pi, sin
from random import Random
from typing import TYPE_CHECKING, ClassVar

from weberlink.compiled import mypyc_attr
from weberlink.geometry.vector import ZERO, Vector, add, confined, cube, interpolate, norm, within
from weberlink.master.devices.contract import DeviceFault, DeviceReading, DeviceSpec, check_finite
from weberlink.master.devices.hand import Tremor, modelled_hand
from weberlink.master.devices.hand_options import HandDeviceOptions

if TYPE_CHECKING:
    from weberlink.master.devices.turning import Turning

LONGEST_GAP = 0.1  # [s] of model time per call; a longer silence makes the hand pause, it does not jump


@mypyc_attr(allow_interpreted_subclasses=True)
class HandDevice:
    """Moves a hand toward an intention, against the commanded force; with a wrist, turns it too.

    Time is that of the model: it goes on with `now`, in equal steps of about a tick, by at most 0.1 s a call. The
    handle stays within the workspace, as on a device with end stops. `intention` gives where the hand means to be at a
    model time [s] from `open`, and whether that is over; `turning` the rotation vector [rad], only with a wrist.
    """

    COMPUTED: ClassVar[bool] = True

    def __init__(
        self,
        name: str,
        options: HandDeviceOptions,
        intention: Callable[[float], tuple[Vector, bool]],
        tick_period: float,
        turning: Callable[[float], Vector] = lambda _: ZERO,
    ) -> None:
        self.spec = DeviceSpec(
            name=name,
            axes="xyz",
            force_n=options.force_n,
            stiffness_n_m=options.stiffness_n_m,
            workspace_m=cube(options.workspace_m),
            rate_hz=1.0 / tick_period,
            force_feedback=True,
            orientation=options.wrist is not None,
            torque_n_m=0.0 if options.wrist is None else options.torque_n_m,
            watchdog_s=0.0,
        )
        self._options = options
        self._intention = intention
        self._tick_period = tick_period
        self._tremor: Tremor | None = None
        if options.tremor_m > 0.0:
            self._tremor = Tremor(options.tremor_m, options.hand, Random(options.seed).random)  # noqa: S311
        self._turning: "Turning | None" = None  # noqa: UP037 - imported below
        if options.wrist is not None:
            from weberlink.master.devices.turning import Turning  # noqa: PLC0415 - with a wrist only

            uniform = Random(f"wrist {options.seed}").random  # noqa: S311
            self._turning = Turning(options.wrist, turning, uniform)
        self._hand = modelled_hand(options.hand, options.home_m)
        self._elapsed = 0.0
        self._felt = ZERO
        self._torque = ZERO
        self._reading: DeviceReading | None = None

    def open(self, now: float) -> None:
        self._hand = modelled_hand(self._options.hand, self._options.home_m)
        self._elapsed = 0.0
        self._felt = self._torque = ZERO
        if self._turning is not None:
            self._turning.begin()
        orientation = None if self._turning is None else self._turning.orientation
        self._reading = DeviceReading(now, self._hand.position, False, orientation)

    def latest(self, now: float) -> DeviceReading:
        reading = self._reading
        if reading is None:
            raise DeviceFault(f"{self.spec.name}: not open")
        if now <= reading.at:
            return reading
        gap = now - reading.at
        gap = gap if gap < LONGEST_GAP else LONGEST_GAP
        count = round(gap / self._tick_period) or 1  # the hand moves exactly at any step
        step = gap / count
        ended = reading.ended
        for _ in range(count):
            self._elapsed += step
            intended, ended = self._intention(self._elapsed)
            if self._tremor is not None:
                intended = add(intended, self._tremor.at(self._elapsed))
            self._hand.advance(intended, self._felt, step)
            if self._turning is not None:
                self._turning.advance(self._elapsed, self._torque, step)
        orientation = None if self._turning is None else self._turning.orientation
        self._reading = DeviceReading(now, confined(self._hand.position, self.spec.workspace_m), ended, orientation)
        return self._reading

    def command(self, force: Vector, now: float) -> None:  # noqa: ARG002
        if not norm(force) <= self.spec.force_n:
            check_finite(self.spec.name, "force", force)
            force = within(force, self.spec.force_n)
        self._felt = force

    def turn(self, torque: Vector, now: float) -> None:  # noqa: ARG002
        """Has no effect without a wrist."""
        check_finite(self.spec.name, "torque", torque)
        self._torque = within(torque, self.spec.torque_n_m)

    def close(self) -> None:
        self._reading = None
        self._felt = self._torque = ZERO


# --- intentions: motion along timed legs


def minimum_jerk(share: float) -> float:
    """10 s^3 - 15 s^4 + 6 s^5: the smoothest way from 0 to 1 (Flash and Hogan 1985)."""
    return share * share * share * (10.0 + share * (6.0 * share - 15.0))


@dataclass(frozen=True, slots=True)
class StraightLeg:
    """Straight from `start` to `end`; with the same point twice, a rest."""

    start: Vector
    end: Vector
    duration: float

    def at(self, time: float) -> Vector:
        """Position [m] at a time [s] from its start, 0 to its duration; at rest at both ends."""
        return interpolate(self.start, self.end, minimum_jerk(time / self.duration))


@dataclass(frozen=True, slots=True)
class CircularLeg:
    """`turns` around `center` in a horizontal plane, counterclockwise from the side of +x; else as `StraightLeg`."""

    center: Vector
    radius: float
    turns: float
    duration: float

    @property
    def end(self) -> Vector:
        return self.at(self.duration)

    def at(self, time: float) -> Vector:
        angle = 2.0 * pi * self.turns * minimum_jerk(time / self.duration)
        x, y, z = self.center
        return (x + self.radius * cos(angle), y + self.radius * sin(angle), z)


class RecordedLeg:
    """Linear between positions [m] at times from 0 on [s], strictly rising."""

    def __init__(self, times: Sequence[float], positions: Sequence[Vector]) -> None:
        self._times, self._positions = times, positions
        self.start, self.end, self.duration = positions[0], positions[-1], times[-1]

    def at(self, time: float) -> Vector:
        index = min(bisect_right(self._times, time), len(self._times) - 1)
        begin, end = self._times[index - 1], self._times[index]
        return interpolate(self._positions[index - 1], self._positions[index], (time - begin) / (end - begin))


Leg = StraightLeg | CircularLeg | RecordedLeg


class LegSequence:
    """Legs one after another, once or for ever; a repeated sequence must end where it begins."""

    def __init__(self, legs: Sequence[Leg], repeat: bool) -> None:
        self._legs = [leg for leg in legs if leg.duration > 0.0]
        if not self._legs:
            raise ValueError("a motion needs at least one leg that takes time")
        self._ends = list(accumulate(leg.duration for leg in self._legs))
        self._repeat = repeat
        self.duration = self._ends[-1]  # duration of one round [s]

    def at(self, time: float) -> tuple[Vector, bool]:
        """Position [m] at `time` [s] from the start, and whether the motion is over."""
        if not self._repeat and time >= self.duration:
            return self._legs[-1].at(self._legs[-1].duration), True
        time = time % self.duration if self._repeat else max(time, 0.0)
        leg, ends_at = self._legs[-1], self.duration
        if time < ends_at:  # else by a rounding of what is left
            index = bisect_right(self._ends, time)
            leg, ends_at = self._legs[index], self._ends[index]
        time -= ends_at - leg.duration
        return leg.at(0.0 if time < 0.0 else time if time < leg.duration else leg.duration), False
