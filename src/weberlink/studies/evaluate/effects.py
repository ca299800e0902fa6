"""What real surfaces do and no predictor of the codec models: friction that depends on speed, texture, and change.

An effect turns the force of an object into the one that robot and hand feel.
"""

from collections.abc import Callable
from math import exp, pi, sin, tanh

from weberlink.geometry.vector import ZERO, Vector, add, dot, norm, scale, subtract

Effect = Callable[[Vector, Vector, Vector, float], Vector]
"""The felt force [N] from the force of the object [N], position [m], velocity [m/s] and time [s]."""

SLOWEST_M_S = 5e-3
"""Scale of the speed over which friction changes its direction; at a fifth of it hand and friction chatter."""


def velocity_friction(static: float, dynamic: float, stribeck_m_s: float, viscous_n_s_m: float) -> Effect:
    """Friction with a Stribeck curve and a viscous part, against the motion along the surface.

    The coefficient falls from `static` to `dynamic` as exp(-(v / v_S)²) (Armstrong-Hélouvry, Dupont, Canudas de Wit, A
    survey of models, analysis tools and compensation methods for the control of machines with friction, 1994).

    Args:
        static: coefficient at rest.
        dynamic: coefficient at high speed.
        stribeck_m_s: v_S, the speed of the fall.
        viscous_n_s_m: damping along the surface in contact.
    """

    def felt(force: Vector, position: Vector, velocity: Vector, time_s: float) -> Vector:
        del position, time_s
        pressure = norm(force)
        if pressure == 0.0:
            return ZERO
        normal = scale(force, 1.0 / pressure)
        along = subtract(velocity, scale(normal, dot(velocity, normal)))
        speed = norm(along)
        if speed == 0.0:
            return force
        coefficient = dynamic + (static - dynamic) * exp(-((speed / stribeck_m_s) ** 2))
        drag = coefficient * pressure * tanh(speed / SLOWEST_M_S) + viscous_n_s_m * speed
        return add(force, scale(along, -drag / speed))

    return felt


def texture(wavelength_m: float, share: float) -> Effect:
    """Ridges along x: the force swings by `share` of itself over every wavelength."""

    def felt(force: Vector, position: Vector, velocity: Vector, time_s: float) -> Vector:
        del velocity, time_s
        return scale(force, 1.0 + share * sin(2.0 * pi * position[0] / wavelength_m))

    return felt


def changing_stiffness(factor: float, every_s: float) -> Effect:
    """An object whose stiffness jumps to `factor` of itself and back, every `every_s`, in contact or not."""

    def felt(force: Vector, position: Vector, velocity: Vector, time_s: float) -> Vector:
        del position, velocity
        return scale(force, factor) if int(time_s / every_s) % 2 else force

    return felt
