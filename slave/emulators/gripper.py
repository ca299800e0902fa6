"""The gripper: a crank that one motor turns, between two stops. Grips nothing, and its motion does not move the arm."""

from math import copysign

from weberlink.slave.emulators.dynamics import STEP, STOP_DAMPING, STOP_STIFFNESS

INERTIA = 0.005  # [kg m^2] of rotor and crank; a guess
COULOMB = 0.02 * STEP  # [N m s] a step; a guess
VISCOUS = 0.02  # [N m s]; a guess
LOWER, UPPER = -1.0, 1.2
"""[rad]; a guess."""


class Gripper:
    """Its angle [rad] and speed [rad/s]."""

    def __init__(self) -> None:
        self.angle = 0.0
        self.velocity = 0.0

    def step(self, torque: float) -> None:
        """Move on by `STEP` under the torque of the motor [N m]."""
        inertia, push = INERTIA + STEP * VISCOUS, INERTIA * self.velocity + STEP * torque
        beyond = min(self.angle - LOWER, 0.0) + max(self.angle - UPPER, 0.0)
        if beyond != 0.0:
            inertia += STEP * (STEP * STOP_STIFFNESS + STOP_DAMPING)
            push -= STEP * STOP_STIFFNESS * beyond
        self.velocity = copysign(max(0.0, abs(push) - COULOMB), push) / inertia
        self.angle += STEP * self.velocity
