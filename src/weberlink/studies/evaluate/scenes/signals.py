"""What a hand and a scene leave behind when nothing lies between them: neither code nor delay.

The hand yields to the force that it feels, as on a real device, and knows nothing of edges, bumps and motions
beforehand. Virtual time at 1 kHz: the same seed gives the same signal, bit for bit, and another one another motion.
"""

from collections.abc import Sequence
from random import Random
from zlib import crc32

import numpy as np

from weberlink.geometry.vector import Vector
from weberlink.master.devices.hand import HandOptions
from weberlink.master.devices.hand_device import HandDevice, HandDeviceOptions
from weberlink.master.devices.motion import LegSequence
from weberlink.slave.scenes.settings import build
from weberlink.studies.evaluate.replay import Signal
from weberlink.studies.evaluate.scenes.catalogue import SCENES, Explored
from weberlink.studies.evaluate.scenes.exploration import Ground, exploration, home

PERIOD_S = 1e-3


def scene_names() -> tuple[str, ...]:
    return tuple(SCENES)


def scene_signals(
    seed: int, duration_s: float = 20.0, noise_n: float = 0.0, names: Sequence[str] | None = None
) -> dict[str, Signal]:
    """The signal of each scene by its name; `names` picks some. The rest is that of `scene_signal`."""
    return {name: scene_signal(name, seed, duration_s, noise_n) for name in (scene_names() if names is None else names)}


def scene_signal(name: str, seed: int, duration_s: float = 20.0, noise_n: float = 0.0) -> Signal:
    """Force and position of a hand that explores a scene.

    Args:
        name: one of `scene_names`.
        seed: of motion, tremor and noise, at least 0.
        duration_s: length of the signal.
        noise_n: of the force sensor, RMS per axis [N], in contact or not. The hand does not feel it, so that the motion
            is that of the signal without.

    Raises:
        KeyError: there is no such scene.
    """
    explored = SCENES[name]
    count = round(duration_s / PERIOD_S)
    random = Random(f"{name} {seed}")  # noqa: S311 - its series is the same on every machine
    forces, positions = _explore(explored, _hand(explored, random, seed, duration_s), count)
    force = np.array(forces).reshape(-1, 3)
    if noise_n > 0.0:
        force = force + np.random.default_rng([crc32(name.encode()), seed]).normal(0.0, noise_n, force.shape)
    return Signal(force, np.array(positions).reshape(-1, 3), PERIOD_S)


def _hand(explored: Explored, random: Random, seed: int, duration_s: float) -> HandDevice:
    hand = HandOptions()
    compliance = 1.0 / hand.stiffness_n_m + 1.0 / explored.thing.stiffness_n_m
    ground = Ground(explored.chart, explored.reach_m, compliance, explored.force_n)
    motion = LegSequence(exploration(ground, duration_s, random), repeat=False)
    options = HandDeviceOptions(hand=hand, seed=seed, home_m=home(ground))
    return HandDevice("exploring", options, motion.at, PERIOD_S)


def _explore(explored: Explored, device: HandDevice, count: int) -> tuple[list[Vector], list[Vector]]:
    """Forces [N] and positions [m]; what is felt in a tick moves the hand in the next."""
    scene = build([explored.thing])
    forces: list[Vector] = []
    positions: list[Vector] = []
    device.open(-PERIOD_S)
    for tick in range(count):
        now = tick * PERIOD_S
        position = device.latest(now).position
        force = scene.force(position, PERIOD_S if tick else 0.0)
        device.command(force, now)
        forces.append(force)
        positions.append(position)
    return forces, positions
