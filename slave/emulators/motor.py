"""What the motor in a servo does with its orders: a current, out of an order, an angle and a speed.

The motor is the one of the XM430-W350 as its manual describes it at 12 V: stall torque 4.1 N m at 2.3 A, 46 rpm without
load. Torque goes with current by the ratio of the first two; gears and friction make that an optimistic straight line,
whose losses the mechanics take as friction of the joint.
"""

from math import pi
from typing import NamedTuple

STALL_A = 2.3
NO_LOAD_RAD_S = 46.0 * 2.0 * pi / 60.0
TORQUE_N_M_PER_A = 4.1 / 2.3
FULL_DUTY = 885
"""Count of the registers of PWM that stands for the whole supply voltage."""
RAD_PER_COUNT = 2.0 * pi / 4096.0
RAD_S_PER_COUNT = 0.229 * 2.0 * pi / 60.0
A_PER_COUNT = 2.69e-3


class Drive(NamedTuple):
    """What a motor is told.

    Args:
        on: Torque enabled.
        current: To be held [A]; None where a position is.
        goal: Angle [rad].
        gain: Duty per error of angle [1/rad].
        duty: Most of it, 0 to 1.
        limit: Of the current [A].
    """

    on: bool = False
    current: float | None = None
    goal: float = 0.0
    gain: float = 0.0
    duty: float = 1.0
    limit: float = STALL_A


OFF = Drive()


def amperes(drive: Drive, angle: float, velocity: float) -> float:
    """The current [A] at an angle [rad] and a speed [rad/s].

    The supply bounds it: at a duty d it is 2.3 A (d - speed / no-load speed). Position control sets the duty in
    proportion to the error; its integral and derivative parts and the profiles, 0 as delivered, are not emulated. Where
    a limit of current applies to position control (mode 5), it cuts what comes out.
    """
    if not drive.on:
        return 0.0
    back = STALL_A * velocity / NO_LOAD_RAD_S
    if drive.current is not None:
        wanted = drive.current
        top, bottom = STALL_A * drive.duty - back, -STALL_A * drive.duty - back
    else:
        duty = min(drive.duty, max(-drive.duty, drive.gain * (drive.goal - angle)))
        wanted = STALL_A * duty - back
        top, bottom = drive.limit, -drive.limit
    return min(top, max(bottom, wanted))
