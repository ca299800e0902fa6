"""Signals of a simulated hand that explores a scene, without codec and delay, for studies of the codec.

The hand yields to the force it feels, as on a real device, and does not know edges, bumps and motions beforehand.
"""

from dataclasses import dataclass
from math import cos, hypot, sin
from random import Random
from zlib import crc32

import numpy as np

from weberlink.geometry.vector import Vector, scale, subtract
from weberlink.master.devices.hand_device import HandDevice
from weberlink.master.devices.hand_options import HandDeviceOptions, HandOptions
from weberlink.master.devices.motion import LegSequence
from weberlink.slave.scenes.height_field import BumpSettings
from weberlink.slave.scenes.settings import (
    FrictionSettings,
    MotionSettings,
    ObjectSettings,
    build,
    object_settings,
)
from weberlink.studies.evaluate.effects import Effect, changing_stiffness, texture, velocity_friction
from weberlink.studies.evaluate.exploration import Chart, ExploredSurface, exploration, home
from weberlink.studies.evaluate.replay import Signal

PERIOD_S = 1e-3
RADIUS_M = 0.05
HOLLOW_M = 0.06
BUMP_M = 0.005
RUBBING = FrictionSettings(static=0.3, dynamic=0.3)
HEAVING = MotionSettings(amplitude_m=0.016, frequency_hz=1.0)
"""Along the normal, at most 0.1 m/s."""
SLIDING = MotionSettings(direction=(1.0, 0.0, 0.0), amplitude_m=0.03, frequency_hz=0.4)
"""Along the surface, at most 0.075 m/s."""

STRIBECK = velocity_friction(static=0.5, dynamic=0.25, stribeck_m_s=0.02, viscous_n_s_m=3.0)
RIDGES = texture(wavelength_m=0.0004, share=0.15)
"""50 to 250 Hz at 0.02 to 0.1 m/s."""


@dataclass(frozen=True, slots=True)
class ExploredScene:
    """A scene of one object.

    Args:
        object: as in a configuration file.
        chart: of its surface.
        reach_m: largest distance of the hand from the middle.
        force_n: least and largest intended force.
        effect: changes the force of the object.
    """

    object: ObjectSettings
    chart: Chart
    reach_m: float = 0.04
    force_n: tuple[float, float] = (0.7, 4.5)
    effect: Effect | None = None


def level(height: float) -> Chart:
    """Chart of the horizontal plane z = `height`."""
    return lambda place: (place[0], place[1], place[2] + height)


def ball(center: Vector, radius: float) -> Chart:
    """Chart of the outside of a ball; u = v = 0 is its top, and straight lines through it are great circles."""
    return lambda place: _spherical(center, radius, place, place[2])


def bowl(center: Vector, radius: float) -> Chart:
    """Chart of the inside of a hollow ball; u = v = 0 is its lowest point."""

    def at(place: Vector) -> Vector:
        x, y, z = _spherical(center, radius, place, -place[2])
        return (x, y, 2.0 * center[2] - z)

    return at


def _spherical(center: Vector, radius: float, place: Vector, outward: float) -> Vector:
    u, v, _ = place
    arc = hypot(u, v)
    if arc == 0.0:
        return (center[0], center[1], center[2] + radius + outward)
    angle, length = arc / radius, radius + outward
    side = length * sin(angle) / arc
    return (center[0] + side * u, center[1] + side * v, center[2] + length * cos(angle))


def _plane(
    stiffness: float,
    *,
    friction: FrictionSettings | None = None,
    damping: float | None = None,
    motion: MotionSettings | None = None,
) -> ObjectSettings:
    return object_settings(
        shape="plane", stiffness_n_m=stiffness, friction=friction, damping_n_s_m=damping, motion=motion
    )


def _sphere(friction: FrictionSettings | None = None) -> ObjectSettings:
    return object_settings(
        shape="sphere", center_m=(0.0, 0.0, -RADIUS_M), radius_m=RADIUS_M, stiffness_n_m=800.0, friction=friction
    )


FLAT = level(0.0)
ROUND = ball((0.0, 0.0, -RADIUS_M), RADIUS_M)

SCENES: dict[str, ExploredScene] = {
    "plane": ExploredScene(_plane(500.0), FLAT),
    "sphere": ExploredScene(_sphere(), ROUND),
    "sphere_cavity": ExploredScene(
        object_settings(
            shape="sphere", center_m=(0.0, 0.0, HOLLOW_M), radius_m=HOLLOW_M, side="inside", stiffness_n_m=600.0
        ),
        bowl((0.0, 0.0, HOLLOW_M), HOLLOW_M),
    ),
    "box": ExploredScene(
        object_settings(shape="box", center_m=(0.0, 0.0, -0.02), size_m=(0.06, 0.06, 0.04), stiffness_n_m=700.0),
        FLAT,
        0.036,
    ),
    "height_field": ExploredScene(
        object_settings(
            shape="height_field", bumps=BumpSettings(amplitude_m=BUMP_M, wavelength_m=0.02), stiffness_n_m=700.0
        ),
        level(BUMP_M / 4.0),
    ),
    "stiff_plane": ExploredScene(_plane(3000.0, damping=6.0), FLAT),
    "soft_plane": ExploredScene(_plane(200.0, damping=4.0), FLAT),
    "plane_friction": ExploredScene(_plane(500.0, friction=RUBBING), FLAT),
    "sphere_friction": ExploredScene(_sphere(RUBBING), ROUND),
    "plane_moving": ExploredScene(_plane(500.0, motion=HEAVING), FLAT, force_n=(1.5, 4.5)),
    "plane_sliding": ExploredScene(_plane(500.0, friction=RUBBING, motion=SLIDING), FLAT),
    "plane_velocity_friction": ExploredScene(_plane(500.0), FLAT, effect=STRIBECK),
    "sphere_velocity_friction": ExploredScene(_sphere(), ROUND, effect=STRIBECK),
    "plane_texture": ExploredScene(_plane(500.0), FLAT, effect=RIDGES),
    "sphere_texture": ExploredScene(_sphere(), ROUND, effect=RIDGES),
    "plane_changing": ExploredScene(_plane(500.0), FLAT, effect=changing_stiffness(2.0, 1.3)),
    "sphere_changing": ExploredScene(_sphere(), ROUND, effect=changing_stiffness(0.5, 1.3)),
}


def scene_names() -> tuple[str, ...]:
    return tuple(SCENES)


def scene_signal(name: str, seed: int, duration_s: float = 20.0, noise_n: float = 0.0) -> Signal:
    """Force and position of a hand that explores a scene, at 1 kHz; the same seed gives the same bits.

    Args:
        name: one of `scene_names`.
        seed: of motion, tremor and noise, at least 0.
        duration_s: length of the signal.
        noise_n: RMS noise of the force sensor per axis [N]. The hand does not feel it, so the motion is that without.

    Raises:
        KeyError: there is no such scene.
    """
    explored = SCENES[name]
    random = Random(f"{name} {seed}")  # noqa: S311 - the same sequence on every machine
    forces, positions = _explore(explored, _hand(explored, random, seed, duration_s), round(duration_s / PERIOD_S))
    force = np.array(forces).reshape(-1, 3)
    if noise_n > 0.0:
        force = force + np.random.default_rng([crc32(name.encode()), seed]).normal(0.0, noise_n, force.shape)
    return Signal(force, np.array(positions).reshape(-1, 3), PERIOD_S)


def _hand(explored: ExploredScene, random: Random, seed: int, duration_s: float) -> HandDevice:
    hand = HandOptions()
    compliance = 1.0 / hand.stiffness_n_m + 1.0 / explored.object.stiffness_n_m
    surface = ExploredSurface(explored.chart, explored.reach_m, compliance, explored.force_n)
    motion = LegSequence(exploration(surface, duration_s, random), repeat=False)
    options = HandDeviceOptions(hand=hand, seed=seed, home_m=home(surface))
    return HandDevice("exploring", options, motion.at, PERIOD_S)


def _explore(explored: ExploredScene, device: HandDevice, count: int) -> tuple[list[Vector], list[Vector]]:
    """Forces [N] and positions [m]; the force of a tick moves the hand in the next."""
    scene, effect = build([explored.object]), explored.effect
    forces: list[Vector] = []
    positions: list[Vector] = []
    device.open(-PERIOD_S)
    for tick in range(count):
        now = tick * PERIOD_S
        position = device.latest(now).position
        force = scene.force(position, PERIOD_S if tick else 0.0)
        if effect is not None:
            velocity = scale(subtract(position, positions[-1] if positions else position), 1.0 / PERIOD_S)
            force = effect(force, position, velocity, now)
        device.command(force, now)
        forces.append(force)
        positions.append(position)
    return forces, positions
