"""A model of how the operator's hand turns the handle."""

from collections.abc import Callable
from math import pi, radians, sin

from weberlink.geometry.rotation import (
    IDENTITY,
    Quaternion,
    inverse,
    product,
    quaternion,
    unit_quaternion,
    vector,
)
from weberlink.geometry.vector import ZERO, Vector, add, scale
from weberlink.master.devices.hand import Tremor, transition
from weberlink.master.devices.hand_options import Oscillator, WristOptions


class Wrist:
    """J dw/dt = -k e - b w + felt, where e is the rotation vector from the intended orientation to that of the handle.

    Axes are those of the device. The inertia is alike about every axis, so there is no gyroscopic torque, and the
    spring is the gradient of k |e|^2 / 2. Every step is the exact solution of the equation as it looks from where it
    begins, laid on the rotations by the exponential map (Lie-Euler): exact for turns about one axis, at any step.
    Held against a constant torque it yields by torque / stiffness.
    """

    def __init__(self, oscillator: Oscillator) -> None:
        self._oscillator = oscillator
        self._compliance = 1.0 / oscillator.stiffness
        self._transition = (0.0, 1.0, 0.0, 0.0, 1.0)
        self.orientation: Quaternion = IDENTITY
        self.velocity: Vector = ZERO  # [rad/s]

    def advance(self, intended: Quaternion, felt: Vector, step: float) -> None:
        """Moves on by `step` [s] toward `intended` under the torque `felt` [N m]."""
        if step != self._transition[0]:
            self._transition = (step, *transition(*self._oscillator, step))
        _, a, b, c, d = self._transition
        compliance, turn, v = self._compliance, vector(product(self.orientation, inverse(intended))), self.velocity
        # Around the resting orientation that this intention and this torque would lead to, it swings freely.
        x, y, z = turn[0] - felt[0] * compliance, turn[1] - felt[1] * compliance, turn[2] - felt[2] * compliance
        a -= 1.0
        way = (a * x + b * v[0], a * y + b * v[1], a * z + b * v[2])
        self.orientation = unit_quaternion(product(quaternion(way), self.orientation)) or intended
        self.velocity = (c * x + d * v[0], c * y + d * v[1], c * z + d * v[2])


class Turning:
    """A wrist that follows a script of rotation vectors [rad], with a slow wobble and tremor added.

    `uniform` draws from [0, 1) for the tremor.
    """

    def __init__(self, options: WristOptions, script: Callable[[float], Vector], uniform: Callable[[], float]) -> None:
        self._oscillator = options.oscillator
        self._script = script
        self._amplitude: Vector = scale(options.wobble_deg, radians(1.0))
        self._frequency = 2.0 * pi * options.wobble_hz
        self._tremor = Tremor(options.tremor_rad, self._oscillator, uniform) if options.tremor_rad > 0.0 else None
        self._wrist = Wrist(self._oscillator)

    @property
    def orientation(self) -> Quaternion:
        """Orientation of the handle in the device's frame."""
        return self._wrist.orientation

    def begin(self) -> None:
        """Reset to rest and level."""
        self._wrist = Wrist(self._oscillator)

    def advance(self, time: float, felt: Vector, step: float) -> None:
        """Moves on by `step` [s] to the model time `time` [s] under the torque `felt` [N m]."""
        shaken = ZERO if self._tremor is None else self._tremor.at(time)
        if self._amplitude != ZERO:
            shaken = add(shaken, scale(self._amplitude, sin(self._frequency * time)))
        intended = quaternion(self._script(time))
        self._wrist.advance(intended if shaken == ZERO else product(quaternion(shaken), intended), felt, step)
