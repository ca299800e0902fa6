"""A model of the operator's hand on the handle: impedance and physiological tremor."""

from collections.abc import Callable, Sequence
from math import ceil, cos, cosh, exp, log2, pi, sin, sinh, sqrt
from typing import Literal, NamedTuple, Protocol

from pydantic import BaseModel, ConfigDict, Field

from weberlink.geometry.vector import ZERO, Vector


class Oscillator(NamedTuple):
    """A mass [kg] or an inertia [kg m^2], its damper and its spring, per metre or per radian."""

    inertia: float
    damping: float
    stiffness: float

    def gain(self, omega: float) -> float:
        """|x / intended| of the free handle at `omega` [rad/s]: k / |k - m omega^2 + j b omega|."""
        return abs(self.stiffness / self.dynamic_stiffness(omega))

    def dynamic_stiffness(self, omega: float) -> complex:
        """Force per displacement at `omega` [rad/s]."""
        return complex(self.stiffness - self.inertia * omega * omega, self.damping * omega)


class GraspOptions(BaseModel):
    """Fingers that hold a handle: spring and damper between the mass of the arm and that of the handle.

    At the frequencies at which a stiff wall becomes unstable, an arm no longer follows the handle, and only grasp and
    handle count. The spring between fingers and handle rises with the grip force, from some hundred newtons per metre
    on, and its damper is a few N s/m: Hajian and Howe, "Identification of the mechanical impedance at the human finger
    tip", J. Biomech. Eng. 119 (1997), for one finger pressed on; Kuchenbecker, Park and Niemeyer, "Characterizing the
    human wrist for improved haptic interaction", ASME IMECE (2003), for a stylus held by fingers and wrist; Hasser and
    Cutkosky, "System identification of the human hand grasping a haptic knob", Haptic Symposium (2002), for the rise
    of both with the grip. The values of `GRASPS` are of this order, chosen and not fitted.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    stiffness_n_m: float = Field(ge=1e-3, le=1e9, description="between arm and handle")
    damping_n_s_m: float = Field(ge=0.0, le=1e6, description="between arm and handle")
    handle_kg: float = Field(default=0.1, ge=1e-6, le=1e3, description="moving mass of the device at its tip")
    handle_damping_n_s_m: float = Field(default=0.1, ge=0.0, le=1e6, description="of the device itself")

    @property
    def oscillator(self) -> Oscillator:
        """Grasp and handle without the damping of the device."""
        return Oscillator(self.handle_kg, self.damping_n_s_m, self.stiffness_n_m)


GRASPS = {
    "pinch": GraspOptions(stiffness_n_m=1500.0, damping_n_s_m=2.3),
    "fingertip": GraspOptions(stiffness_n_m=650.0, damping_n_s_m=1.1),
}
"""Grasps by name. A wall felt a tick of 1 ms late is stable up to 2,240 and 1,120 N/m with them, and up to 5,370 N/m
with the hand that has none and holds firmly."""


class HandOptions(BaseModel):
    """Impedance of hand and handle.

    The defaults are those of a firm, posture-keeping arm. The order of magnitude is that of van Beek, Bergmann Tiest,
    Mugge and Kappers, "Haptic perception of force magnitude and its relation to postural arm dynamics in 3D", Sci. Rep.
    5:18004 (2015), where one trial gave 0.55 kg, 6.5 N s/m and 135 N/m.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    mass_kg: float = Field(
        default=0.3, ge=1e-6, le=1e3, description="hand and handle; the hand alone if it has a grasp"
    )
    damping_n_s_m: float = Field(default=8.0, ge=0.0, le=1e6)
    stiffness_n_m: float = Field(
        default=300.0, ge=1e-3, le=1e9, description="how hard it holds on to where it wants to be"
    )
    grasp: Literal["pinch", "fingertip"] | GraspOptions | None = Field(
        default=None, description="how fingers hold the handle; without it, hand and handle are one mass"
    )

    @property
    def damping_at_handle(self) -> float:
        """Damping that a wall at the handle meets at high frequency, where the arm no longer follows [N s/m]."""
        held = self.held
        return self.damping_n_s_m if held is None else held.damping_n_s_m + held.handle_damping_n_s_m

    @property
    def held(self) -> GraspOptions | None:
        """The grasp that is meant, also where it is named."""
        return GRASPS[self.grasp] if isinstance(self.grasp, str) else self.grasp

    @property
    def oscillator(self) -> Oscillator:
        """The mass that the intention acts on, without the grasp."""
        return Oscillator(self.mass_kg, self.damping_n_s_m, self.stiffness_n_m)

    @property
    def static_stiffness(self) -> float:
        """Force per displacement of the handle at rest [N/m]: the springs in series."""
        held = self.held
        return self.stiffness_n_m if held is None else 1.0 / (1.0 / self.stiffness_n_m + 1.0 / held.stiffness_n_m)

    def gain(self, omega: float) -> float:
        """|x / intended| of the free handle at `omega` [rad/s]."""
        held = self.held
        if held is None:
            return self.oscillator.gain(omega)
        grasp = complex(held.stiffness_n_m, held.damping_n_s_m * omega)
        handle = complex(-held.handle_kg * omega * omega, held.handle_damping_n_s_m * omega)
        arm = self.oscillator.dynamic_stiffness(omega) + grasp * handle / (grasp + handle)
        return abs(self.stiffness_n_m / arm * grasp / (grasp + handle))


class Hand(Protocol):
    """A hand on a handle, per axis, with the position [m] and velocity [m/s] of the handle.

    Integrated by the exact solution for an intention and a force that are constant over the step, so it is stable at
    any step. Held against a constant force it yields by force / `static_stiffness`.
    """

    position: Vector
    velocity: Vector

    def advance(self, intended: Vector, felt: Vector, step: float) -> None:
        """Moves on by `step` [s] toward `intended` [m] under the force `felt` [N] on the handle."""
        ...

    def stored(self, intended: Vector) -> float:
        """Energy of its masses and springs [J], about the intention [m]."""
        ...


def modelled_hand(options: HandOptions, position: Vector) -> Hand:
    """A hand at rest at a position [m], as its own intention."""
    held = options.held
    return FirmHand(options, position) if held is None else GraspingHand(options, held, position)


class FirmHand:
    """m a = k (intended - x) - b v + felt: hand and handle move as one mass."""

    __slots__ = ("_damping", "_mass", "_stiffness", "_transition", "position", "velocity")

    def __init__(self, options: HandOptions, position: Vector) -> None:
        self._mass = options.mass_kg
        self._damping = options.damping_n_s_m
        self._stiffness = options.stiffness_n_m
        self._transition = (0.0, 1.0, 0.0, 0.0, 1.0)
        self.position = position
        self.velocity = ZERO

    def advance(self, intended: Vector, felt: Vector, step: float) -> None:
        if step != self._transition[0]:
            self._transition = (step, *transition(self._mass, self._damping, self._stiffness, step))
        _, a, b, c, d = self._transition
        compliance = 1.0 / self._stiffness
        p, v = self.position, self.velocity
        # Around the resting point that this intention and this force would lead to, the motion is a free oscillation.
        rest_x, rest_y, rest_z = (
            intended[0] + felt[0] * compliance,
            intended[1] + felt[1] * compliance,
            intended[2] + felt[2] * compliance,
        )
        x, y, z = p[0] - rest_x, p[1] - rest_y, p[2] - rest_z
        self.position = (rest_x + a * x + b * v[0], rest_y + a * y + b * v[1], rest_z + a * z + b * v[2])
        self.velocity = (c * x + d * v[0], c * y + d * v[1], c * z + d * v[2])

    def stored(self, intended: Vector) -> float:
        stretch, speed = squared_distance(self.position, intended), squared_distance(self.velocity, ZERO)
        return 0.5 * (self._stiffness * stretch + self._mass * speed)


class GraspingHand:
    """Arm (x', v', m') and handle (x, v, m), coupled by the spring k and the damper b of the grasp:

    m' a' = k' (intended - x') - b' v' + k (x - x') + b (v - v')
    m a = k (x' - x) + b (v' - v) - c v + felt

    The intention acts on the arm, the force on the handle, which alone has the damping c of the device.
    """

    __slots__ = ("_grasp", "_options", "_step", "_steps", "arm", "arm_velocity", "position", "velocity")

    def __init__(self, options: HandOptions, grasp: GraspOptions, position: Vector) -> None:
        self._options, self._grasp = options, grasp
        self._step = 0.0
        self._steps: Sequence[Sequence[float]] = ()
        self.position = self.arm = position
        self.velocity = self.arm_velocity = ZERO

    def advance(self, intended: Vector, felt: Vector, step: float) -> None:
        if step != self._step:
            self._step, self._steps = step, handle_and_arm(self._options, self._grasp, step)
        axes = zip(self.position, self.velocity, self.arm, self.arm_velocity, intended, felt, strict=True)
        (a, b, c, d, e), (f, g, h, i, j), (k, m, n, o, p), (q, r, s, t, u) = self._steps
        after = [
            (
                to + a * (x - to) + b * v + c * (y - to) + d * w + e * force,
                f * (x - to) + g * v + h * (y - to) + i * w + j * force,
                to + k * (x - to) + m * v + n * (y - to) + o * w + p * force,
                q * (x - to) + r * v + s * (y - to) + t * w + u * force,
            )
            for x, v, y, w, to, force in axes
        ]
        self.position, self.velocity, self.arm, self.arm_velocity = zip(*after, strict=True)

    def stored(self, intended: Vector) -> float:
        options, grasp = self._options, self._grasp
        return 0.5 * (
            options.stiffness_n_m * squared_distance(self.arm, intended)
            + grasp.stiffness_n_m * squared_distance(self.position, self.arm)
            + options.mass_kg * squared_distance(self.arm_velocity, ZERO)
            + grasp.handle_kg * squared_distance(self.velocity, ZERO)
        )


def squared_distance(a: Vector, b: Vector) -> float:
    return (a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2 + (a[2] - b[2]) ** 2


def handle_and_arm(options: HandOptions, grasp: GraspOptions, step: float) -> list[list[float]]:
    """The exact step of `GraspingHand` about an intention at 0.

    Returns:
        Position and velocity of the handle, then of the arm, after a step [s]; columns: the same before it, and the
        response to 1 N held on the handle. Shape (4, 5).
    """
    arm, (handle, damping, stiffness), own = options.oscillator, grasp.oscillator, grasp.handle_damping_n_s_m
    rates = [
        [0.0, 1.0, 0.0, 0.0, 0.0],
        [-stiffness / handle, -(damping + own) / handle, stiffness / handle, damping / handle, 1.0 / handle],
        [0.0, 0.0, 0.0, 1.0, 0.0],
        [
            stiffness / arm.inertia, damping / arm.inertia,
            -(stiffness + arm.stiffness) / arm.inertia, -(damping + arm.damping) / arm.inertia, 0.0,
        ],
        [0.0, 0.0, 0.0, 0.0, 0.0],
    ]  # fmt: skip
    return exponential([[rate * step for rate in row] for row in rates])[:4]


def exponential(matrix: Sequence[Sequence[float]]) -> list[list[float]]:
    """exp(A) of a small square matrix, by scaling, the Taylor series and squaring.

    The identity is kept apart until the end, (1 + E)^2 - 1 = 2 E + E^2: else a tick that changes little would be lost
    in the rounding of ones.
    """
    size = range(len(matrix))
    largest = max(sum(map(abs, row)) for row in matrix)
    halvings = max(0, ceil(log2(largest)) + 3) if largest > 0.0 else 0
    scaled = [[value / 2.0**halvings for value in row] for row in matrix]
    change, term = scaled, scaled
    for order in range(2, TERMS + 1):
        term = [[value / order for value in row] for row in _product(term, scaled)]
        change = [[change[i][j] + term[i][j] for j in size] for i in size]
    for _ in range(halvings):
        squared = _product(change, change)
        change = [[2.0 * change[i][j] + squared[i][j] for j in size] for i in size]
    return [[change[i][j] + (i == j) for j in size] for i in size]


TERMS = 12
"""Of the Taylor series; the norm of its matrix is at most 1/8, so the remainder is below 1e-21."""


def _product(a: Sequence[Sequence[float]], b: Sequence[Sequence[float]]) -> list[list[float]]:
    columns = list(zip(*b, strict=True))
    return [[sum(x * y for x, y in zip(row, column, strict=True)) for column in columns] for row in a]


def transition(mass: float, damping: float, stiffness: float, step: float) -> tuple[float, float, float, float]:
    """exp(A h) of m a = -k x - b v, row by row, in closed form.

    With s = b / 2m and w^2 = k/m - s^2: exp(-s h) [[C + s S, S], [-k/m S, C - s S]] where C = cos(w h), S = sin(w h)
    / w; hyperbolic for w^2 < 0, and C = 1, S = h at w = 0.
    """
    decay = damping / (2.0 * mass)
    squared = stiffness / mass - decay * decay
    angle, faded = sqrt(abs(squared)) * step, exp(-decay * step)
    if angle == 0.0:
        even, odd = faded, faded * step
    elif squared > 0.0:
        even, odd = faded * cos(angle), faded * sin(angle) / angle * step
    elif angle < 1.0:
        even, odd = faded * cosh(angle), faded * sinh(angle) / angle * step
    else:  # both exponents are negative; multiplied out, so that neither factor overflows
        slow, fast = exp(angle - decay * step), exp(-angle - decay * step)
        even, odd = (slow + fast) / 2.0, (slow - fast) / (2.0 * angle) * step
    return even + decay * odd, odd, -stiffness / mass * odd, even - decay * odd


LOWEST_HZ, HIGHEST_HZ = 8.0, 12.0
COMPONENTS = 4
Waves = tuple[float, float, float, float, float, float, float, float, float, float, float, float]
"""Amplitude, angular frequency [rad/s] and phase [rad] of each component."""


class Tremor:
    """Displacement of the intended position that makes the free hand tremble by `rms` along each axis.

    A few sinusoids between 8 and 12 Hz (the band of the neural component; Elble, "Physiologic and enhanced
    physiologic tremor", Handbook of Clinical Neurophysiology 1, 2003) with drawn frequencies and phases: a pure
    function of time, and reproducible. Each is divided by the gain of the hand at its frequency, so that it is the
    hand that trembles by the stated amount; against a wall it yields like any other intention. The same holds for the
    orientation, with a rotation vector in place of the position.

    Args:
        rms: Root mean square per axis of the free hand [m] or [rad]; some tens of micrometres in a healthy adult.
        hand: What the tremor passes through.
        uniform: Draws from [0, 1).
    """

    __slots__ = ("_x", "_y", "_z")

    def __init__(self, rms: float, hand: Oscillator | HandOptions, uniform: Callable[[], float]) -> None:
        self._x, self._y, self._z = [_drawn(rms, hand, uniform) for _ in range(3)]

    def at(self, time: float) -> Vector:
        """Displacement [m] or [rad] of the intention at `time` [s]."""
        return (_sum(self._x, time), _sum(self._y, time), _sum(self._z, time))


def _drawn(rms: float, hand: Oscillator | HandOptions, uniform: Callable[[], float]) -> Waves:
    waves: list[float] = []
    for _ in range(COMPONENTS):
        omega = 2.0 * pi * (LOWEST_HZ + (HIGHEST_HZ - LOWEST_HZ) * uniform())
        waves += (rms * sqrt(2.0 / COMPONENTS) / hand.gain(omega), omega, 2.0 * pi * uniform())
    a, w, p, b, x, q, c, y, r, d, z, s = waves
    return a, w, p, b, x, q, c, y, r, d, z, s


def _sum(waves: Waves, time: float) -> float:
    """Written out for speed: it runs three times a tick."""
    a, w, p, b, x, q, c, y, r, d, z, s = waves
    return a * sin(w * time + p) + b * sin(x * time + q) + c * sin(y * time + r) + d * sin(z * time + s)


class WristOptions(BaseModel):
    """Rotational impedance of hand and handle about the tip, the same about every axis, with tremor and wobble.

    The defaults are an assumption, not a measurement: natural frequency (5 Hz) and damping ratio (0.42) are those of
    the hand that moves, and 2 N m/rad is meant for a hand that holds on. A real wrist is stiffer in some directions
    than in others, and relaxed it is softer (Formica, Charles, Zollo, Guglielmelli, Hogan and Krebs, "The passive
    stiffness of the wrist and forearm", J. Neurophysiol. 108, 2012).
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    inertia_kg_m2: float = Field(default=0.002, ge=1e-9, le=1e3, description="hand and handle")
    damping_n_m_s_rad: float = Field(default=0.053, ge=0.0, le=1e6)
    stiffness_n_m_rad: float = Field(
        default=2.0, ge=1e-6, le=1e9, description="how hard it holds on to how it wants to be"
    )
    tremor_rad: float = Field(
        default=0.0005, ge=0.0, le=0.1, description="RMS about each axis of the free hand, 8 to 12 Hz; 0 for none"
    )
    wobble_deg: Vector = Field(
        default=ZERO, description="amplitude of a slow turning about x, y, z on top of the script, as one who explores"
    )
    wobble_hz: float = Field(default=0.3, gt=0.0, le=5.0)

    @property
    def oscillator(self) -> Oscillator:
        return Oscillator(self.inertia_kg_m2, self.damping_n_m_s_rad, self.stiffness_n_m_rad)
