"""The measured force and torque: the robot's estimate without its offset, and checked for its sign."""

from math import isfinite
from typing import Final

from weberlink.geometry.vector import ZERO, Vector, add, dot, norm, scale, subtract

SETTLE_CYCLES: Final = 200
TARE_CYCLES: Final = 200  # the offset is the mean over so many cycles, after the arm has held for the cycles before
PRESSED_N: Final = 5.0
AGREEMENT: Final = 0.5
"""Spring and measured force contradict each other if both are larger than that, and point the same way within the angle
of this cosine."""
STILL_RAD_S: Final = 0.05
CONTRADICTED_CYCLES: Final = 300  # for so long, while no joint is faster


SINGULAR_CYCLES: Final = 50  # the estimate has failed when it is exactly 0 for so long and was not at opening


class SensingError(RuntimeError):
    """The estimate cannot be used, with one line that says why."""


class ExternalForce:
    """What the environment does to the tip.

    The robot states the wrench that it applies to its surroundings (libfranka, robot_state.h: "forces applied by the
    robot to the environment are positive"); the reaction is reported here. At rest it is opposite to the spring, so a
    force that points the way the spring does has the wrong sign, and would turn a wall into a motor at the hand. Near a
    singularity the robot states exactly 0 (ibid.), which must not be taken for freedom from contact. `most` is the
    largest force that may be subtracted as an offset [N].
    """

    def __init__(self, most: float) -> None:
        self._most = most
        self._cycles = self._contradicted = self._silent = 0
        self._force_offset, self._torque_offset = ZERO, ZERO
        self.ready = False  # the offset is known
        self.force, self.torque = ZERO, ZERO  # on the robot at the last `take` [N], about the tip [N m]

    def take(self, wrench: list[float], spring: Vector, joint_speed: float) -> None:
        """Take the estimate of one cycle, O_F_ext_hat_K of the robot [N, N m], while the impedance presses with the
        force `spring` [N]; SensingError if it is not finite, its offset is too large, it has failed, or its sign
        contradicts the spring.
        """
        fx, fy, fz, tx, ty, tz = wrench
        if not isfinite(fx + fy + fz + tx + ty + tz):
            raise SensingError("the robot reports a force that is not finite")
        force, torque = (-fx, -fy, -fz), (-tx, -ty, -tz)
        if not self.ready:
            self._tare(force, torque)
        self._silent = self._silent + 1 if force == torque == ZERO and self._force_offset != ZERO else 0
        if self._silent >= SINGULAR_CYCLES:
            raise SensingError(
                "the robot estimates no force: it is near a singularity, or was not free at opening; guide it elsewhere"
            )
        self.force, self.torque = subtract(force, self._force_offset), subtract(torque, self._torque_offset)
        self._check_sign(spring, joint_speed)

    def _tare(self, force: Vector, torque: Vector) -> None:
        self._cycles += 1
        if self._cycles <= SETTLE_CYCLES:
            return
        share = 1.0 / TARE_CYCLES
        self._force_offset = add(self._force_offset, scale(force, share))
        self._torque_offset = add(self._torque_offset, scale(torque, share))
        if self._cycles < SETTLE_CYCLES + TARE_CYCLES:
            return
        self.ready = True
        if norm(self._force_offset) > self._most:
            raise SensingError(
                f"the robot reports {norm(self._force_offset):.1f} N at rest; free it from contact, or set mass and "
                "centre of its end effector in Desk"
            )

    def _check_sign(self, spring: Vector, joint_speed: float) -> None:
        pressed, felt = norm(spring), norm(self.force)
        contradicts = pressed > PRESSED_N and felt > PRESSED_N and dot(spring, self.force) > AGREEMENT * pressed * felt
        self._contradicted = self._contradicted + 1 if contradicts and joint_speed < STILL_RAD_S else 0
        if self.ready and self._contradicted >= CONTRADICTED_CYCLES:
            raise SensingError(
                f"the arm presses with {pressed:.1f} N and measures {felt:.1f} N the same way: the sign of its "
                "estimate is wrong, or the mass of its end effector in Desk"
            )
