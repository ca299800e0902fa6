"""Calibration of the torque of an axis with weights: what a load and a current of its servo mean in N m.

Run it as `python -m weberlink_arms.feetech.calibration`; docs/arms/so101.md describes the procedure. The servo holds a
lever of known length level, with one weight after the other on it, and comes to that place from above and from below:
the mean of both loads carries the weight, half their difference the friction of the gears. A line through the means has
the torque of a load as its slope; what the lever itself weighs is its intercept.
"""

import argparse
import sys
from collections.abc import Callable, Sequence
from statistics import fmean, linear_regression
from time import monotonic, sleep
from typing import Final, NamedTuple

from weberlink.hardware.fault import HardwareFault
from weberlink.hardware.serial_port import SerialPort
from weberlink_arms.feetech import registers
from weberlink_arms.feetech.arm import SO101, So101Options
from weberlink_arms.feetech.bus import FeetechBus, FeetechServos
from weberlink_arms.feetech.packet import FRAMING
from weberlink_arms.feetech.registers import ORDER_ADDRESS, ORDER_SIZE, Present
from weberlink_arms.servo.layout import RAD_PER_COUNT

GRAVITY_M_S2: Final = 9.81
SWAY_RAD: Final = 0.15  # how far the servo moves away before it comes back from that side
SETTLE_S: Final = 1.5
READINGS: Final = 100
P_GAIN: Final = 32
FULL_TORQUE: Final = 1000
MOST_LOAD: Final = 700  # load beyond which the servo's own protection is near (register 36, 80 %)


class Weighing(NamedTuple):
    """Means at one weight: its torque [N m], load in 0.1 %, current [A], friction as a load in 0.1 %, supply [V]."""

    torque: float
    load: float
    current: float
    friction: float
    supply: float


class TorqueScale(NamedTuple):
    """Torque of a load of 0.1 % and of a current of 1 A, friction [N m], and the supply at which this holds [V]."""

    per_load: float
    per_amp: float
    friction: float
    supply: float
    error: float  # largest distance of a weighing from the line [N m]


def fit(weighings: Sequence[Weighing]) -> TorqueScale:
    """The scale of an axis; ValueError if there are fewer than three weights, or the load does not follow them."""
    if len({each.torque for each in weighings}) < 3:
        raise ValueError("expected at least three different weights; none at all is one of them")
    torques, loads, currents = ([each[column] for each in weighings] for column in (0, 1, 2))
    if min(len(set(loads)), len(set(currents))) == 1:
        raise ValueError("the servo measures the same with every weight: is the weight on the lever of this joint?")
    per_load, own = linear_regression(loads, torques)
    per_amp, _ = linear_regression(currents, torques)
    friction = abs(per_load) * fmean([each.friction for each in weighings])
    error = max(abs(per_load * each.load + own - each.torque) for each in weighings)
    return TorqueScale(abs(per_load), abs(per_amp), friction, fmean([each.supply for each in weighings]), error)


class Scales:
    """An arm that weighs with the axis of this number; its servos were found, and all hold their places.

    `settle` is the time to come to a place and to rest there, `pause` sleeps [s].
    """

    def __init__(
        self,
        servos: FeetechServos,
        axis: int,
        settle: float = SETTLE_S,
        clock: Callable[[], float] = monotonic,
        pause: Callable[[float], None] = sleep,
    ) -> None:
        self._servos, self._axis, self._settle = servos, axis, settle
        self._clock, self._pause = clock, pause
        servos.prepare(P_GAIN)
        self._level = [each.position for each in self._first()]
        self._hold(self._level)

    def weigh(self, torque: float) -> Weighing:
        """Weigh a torque [N m] that is on the axis now; HardwareFault if it is too heavy, or as of the bus."""
        above, below = self._come_from(SWAY_RAD), self._come_from(-SWAY_RAD)
        both = above + below
        load = fmean([each.load for each in both])
        if abs(load) > MOST_LOAD:
            raise HardwareFault(
                f"{SO101.axes[self._axis]}: a load of {abs(load) / 10:.0f} % is too much; take a lighter weight"
            )
        sense = 1.0 if load >= 0.0 else -1.0
        return Weighing(
            torque,
            load,
            sense * fmean([each.current for each in both]) * registers.A_PER_COUNT,
            0.5 * abs(fmean([each.load for each in above]) - fmean([each.load for each in below])),
            fmean([each.voltage for each in both]) * registers.V_PER_COUNT,
        )

    def release(self) -> None:
        """Take the torque off; the arm drops."""
        self._servos.release()

    def _come_from(self, side: float) -> list[Present]:
        away = list(self._level)
        away[self._axis] += round(side / RAD_PER_COUNT)
        self._hold(away)
        self._wait(self._settle)
        self._hold(self._level)
        self._wait(self._settle)
        return [self._first()[self._axis] for _ in range(READINGS)]

    def _hold(self, goals: Sequence[int]) -> None:
        ids = self._servos.bus.ids
        orders = [(id_, registers.order(True, goal, FULL_TORQUE)) for id_, goal in zip(ids, goals, strict=True)]
        self._servos.bus.send(FRAMING.sync_write(ORDER_ADDRESS, ORDER_SIZE, orders))

    def _first(self) -> list[Present]:
        return self._servos.bus.insist(self._servos.bus.present)

    def _wait(self, time: float) -> None:
        until = self._clock() + time
        while self._clock() < until:
            self._first()  # an error of a servo ends the weighing
            self._pause(0.02)


def main(
    arguments: Sequence[str] | None = None, ask: Callable[[str], object] = input, say: Callable[[str], object] = print
) -> int:
    """Ask for one weight after the other, and print the options; returns the exit status."""
    parser = argparse.ArgumentParser(prog="python -m weberlink_arms.feetech.calibration", description=__doc__)
    parser.add_argument("--port", required=True, help="of the board")
    parser.add_argument("--joint", required=True, choices=SO101.axes)
    parser.add_argument("--lever-m", required=True, type=float, help="from the axis to the weight, level")
    parser.add_argument("--masses-kg", required=True, type=float, nargs="+", help="at least three; 0 for none")
    given = parser.parse_args(arguments)
    options = So101Options(port=given.port)
    try:
        port = SerialPort(given.port, options.baud)
    except HardwareFault as fault:
        say(str(fault))
        return 1
    servos = FeetechServos(FeetechBus(port, options.baud, options.bus_ids, SO101.axes, options.margin_s))
    try:
        servos.find()
        _dialog(servos, given, ask, say)
    except (HardwareFault, ValueError) as fault:
        say(str(fault))
        return 1
    finally:
        servos.release()
        port.close()
    return 0


def _dialog(
    servos: FeetechServos, given: argparse.Namespace, ask: Callable[[str], object], say: Callable[[str], object]
) -> None:
    ask(f"Hold the arm with the lever of {given.joint} level, and press Enter: all servos hold their places then.")
    scales = Scales(servos, SO101.axes.index(given.joint))
    weighings = []
    for mass in given.masses_kg:
        ask(f"Hang {mass:g} kg at {given.lever_m:g} m, keep off (it sways by 9 degrees), and press Enter.")
        weighings.append(scales.weigh(mass * GRAVITY_M_S2 * given.lever_m))
        say(f"  load {weighings[-1].load / 10:.1f} %, current {abs(weighings[-1].current):.3f} A")
    scale = fit(weighings)
    say(f"{given.joint}: entry {SO101.axes.index(given.joint) + 1} of each option")
    say(f"torque_per_load_nm: {scale.per_load:.6f}   # within {scale.error:.3f} N m of every weight")
    say(f"torque_per_amp_nm: {scale.per_amp:.4f}")
    say(f"friction_nm: {scale.friction:.3f}")
    say(f"rated_v: {scale.supply:.1f}")
    ask("Hold the arm, and press Enter: the torque goes off.")


if __name__ == "__main__":
    sys.exit(main())
