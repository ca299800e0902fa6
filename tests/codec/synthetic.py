"""Synthetic forces that no predictor of the codec models, over a hand that moves independently of them.

A seed draws times, levels and phases; the tick rate only says where the same signal is sampled (white noise is drawn
for every sample). Forces act along one random direction about a constant force, unless the signal says otherwise.
"""

from collections.abc import Callable
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

from weberlink.geometry.vector import Vector

Array = NDArray[np.float64]

Random = np.random.Generator
Times = Array
"""Shape (n,) [s]."""
Force = Callable[[Times, float, Random], Array]
"""Force at each time, shape (n,) along the direction or (n, 3) [N], of a signal of some duration [s]."""

HAND_M = 4e-3
"""Amplitude of each of the hand's three sinusoids on each axis."""
WHITE_N = 0.05


def synthetic_names() -> tuple[str, ...]:
    return tuple(SYNTHETIC)


def synthetic_signal(name: str, seed: int, duration_s: float, period_s: float) -> list[tuple[Vector, Vector]]:
    """Force [N] and position [m] of a synthetic signal, tick by tick; the same arguments give the same bits.

    Args:
        name: one of `synthetic_names`.
        seed: of everything that is random, at least 0.
        duration_s: length of the signal.
        period_s: time between samples.

    Raises:
        KeyError: there is no such signal.
    """
    make = SYNTHETIC[name]
    time: Times = np.arange(round(duration_s / period_s), dtype=np.float64) * period_s
    random = np.random.default_rng([crc32(name.encode()), seed])
    direction = random.normal(size=3)
    direction /= np.linalg.norm(direction)
    position = _hand(time, random)
    force = make(time, duration_s, random)
    force = np.outer(force, direction) if force.ndim == 1 else force
    pairs = zip(force.tolist(), position.tolist(), strict=True)
    return [((fx, fy, fz), (x, y, z)) for (fx, fy, fz), (x, y, z) in pairs]


def _hand(time: Times, random: Random) -> Array:
    """Three slow sinusoids on each axis."""
    frequencies, phases = random.uniform(0.2, 2.0, (3, 3)), random.uniform(0.0, 2.0 * np.pi, (3, 3))
    waves = np.sin(2.0 * np.pi * time[:, None, None] * frequencies + phases)
    return np.asarray(HAND_M * waves.sum(axis=2))


def _smooth(time: Times, random: Random) -> Array:
    """A press of 0.5 to 3.5 N that changes slowly."""
    first, second = random.uniform(0.0, 2.0 * np.pi, 2)
    press = 2.0 + np.sin(2.0 * np.pi * 0.5 * time + first) + 0.5 * np.sin(2.0 * np.pi * 1.3 * time + second)
    return np.asarray(press)


def _events(rate_hz: float, duration_s: float, random: Random) -> Array:
    """Random times of a Poisson process, from 0 on."""
    count = random.poisson(rate_hz * duration_s)
    return np.sort(random.uniform(0.0, duration_s, count))


def _number(time: Times, events: Array) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    """How many events were before each time."""
    return np.searchsorted(events, time, side="right")


def _phase(time: Times, frequency_hz: float, random: Random) -> Array:
    """Share of the present period, from 0 to 1."""
    return np.asarray((time * frequency_hz + random.uniform()) % 1.0)


def _step(time: Times, duration_s: float, random: Random) -> Array:
    """Levels of 0.5 to 4 N, two a second."""
    events = _events(2.0, duration_s, random)
    levels: Array = random.uniform(0.5, 4.0, len(events) + 1)
    return levels[_number(time, events)]


def _square(time: Times, duration_s: float, random: Random) -> Array:
    del duration_s
    return np.where(_phase(time, 2.0, random) < 0.5, 1.0, 3.0)


def _chirp(time: Times, duration_s: float, random: Random) -> Array:
    """From 0.5 to 50 Hz, 2 N ± 1 N."""
    low, high = 0.5, 50.0
    growth = np.log(high / low) / duration_s
    turned = 2.0 * np.pi * low * np.expm1(growth * time) / growth
    return np.asarray(2.0 + np.sin(turned + random.uniform(0.0, 2.0 * np.pi)))


def _triangle(time: Times, duration_s: float, random: Random) -> Array:
    del duration_s
    return 0.5 + 6.0 * np.abs(_phase(time, 1.0, random) - 0.5)


def _saw(time: Times, duration_s: float, random: Random) -> Array:
    """Stick-slip: the force rises at 8 N/s, and slips back within 2 ms at random times, five a second."""
    events = np.concatenate(([0.0], _events(5.0, duration_s, random)))
    events = events[np.diff(events, prepend=-1.0) > 0.02]
    since = time - events[_number(time, events) - 1]
    before = np.concatenate(([0.0], np.diff(events)))[_number(time, events) - 1]
    return 0.5 + 8.0 * np.where(since < 2e-3, before + (2e-3 - before) * since / 2e-3, since)


def _texture(time: Times, duration_s: float, random: Random) -> Array:
    """A press with a vibration whose frequency wanders from 50 to 250 Hz, as that of ridges under a stroking hand."""
    rate, start = random.uniform(0.3, 0.7), random.uniform(0.0, 2.0 * np.pi)
    turned = 2.0 * np.pi * (150.0 * time - 100.0 / (2.0 * np.pi * rate) * np.cos(2.0 * np.pi * rate * time + start))
    del duration_s
    press = _smooth(time, random)
    return press * (1.0 + 0.15 * np.sin(turned))


def _drop_outs(time: Times, duration_s: float, random: Random) -> Array:
    """A press that is 0 for 1 to 5 ms, three times a second."""
    events = np.concatenate(([-1.0], _events(3.0, duration_s, random)))
    lengths = random.uniform(1e-3, 5e-3, len(events))
    last = _number(time, events) - 1
    return np.where(time - events[last] < lengths[last], 0.0, _smooth(time, random))


def _quantised(time: Times, duration_s: float, random: Random) -> Array:
    """A press in steps of 0.1 N."""
    del duration_s
    return np.round(_smooth(time, random), 1)


def _held(time: Times, duration_s: float, random: Random) -> Array:
    """A press from a sensor of 100 Hz."""
    del duration_s
    return _smooth(np.floor(time * 100.0 + 1e-9) / 100.0, random)


def _drift(time: Times, duration_s: float, random: Random) -> Array:
    """A force that creeps by 50 mN/s."""
    del duration_s
    return 2.0 + 0.05 * time + 0.02 * np.sin(2.0 * np.pi * 0.2 * time + random.uniform(0.0, 2.0 * np.pi))


def _spikes(time: Times, duration_s: float, random: Random) -> Array:
    """A press with spikes of ±2 N that last 1 ms, three a second."""
    events = np.concatenate(([-1.0], _events(3.0, duration_s, random)))
    signs = random.choice((-2.0, 2.0), len(events))
    last = _number(time, events) - 1
    return _smooth(time, random) + np.where(time - events[last] < 1e-3, signs[last], 0.0)


def _switching(time: Times, duration_s: float, random: Random) -> Array:
    """A constant, a ramp, a vibration of 5 Hz or noise of 20 mN, about one second each."""
    events = _events(1.0, duration_s, random)
    number = _number(time, events)
    kinds = random.integers(0, 4, len(events) + 1)
    levels = random.uniform(1.0, 3.0, len(events) + 1)
    since = time - np.concatenate(([0.0], events))[number]
    noise = random.normal(0.0, 0.02, len(time))
    changes = np.choose(kinds[number], (0.0 * time, 0.8 * since, 0.5 * np.sin(2.0 * np.pi * 5.0 * since), noise))
    return np.asarray(levels[number] + changes)


def _white_noise(time: Times, duration_s: float, random: Random) -> Array:
    """A press with white noise of 50 mN on each axis, drawn for every sample."""
    del duration_s
    press = np.outer(_smooth(time, random), (0.0, 0.0, 1.0))
    return np.asarray(press + random.normal(0.0, WHITE_N, press.shape))


def _turning(time: Times, duration_s: float, random: Random) -> Array:
    """A force of 2 N that turns steadily, twice a second, in a random plane."""
    del duration_s
    frame, _ = np.linalg.qr(random.normal(size=(3, 3)))
    angle = 2.0 * np.pi * 2.0 * time
    return np.asarray(2.0 * (np.outer(np.cos(angle), frame[0]) + np.outer(np.sin(angle), frame[1])))


def _damped_impact(time: Times, duration_s: float, random: Random) -> Array:
    """Two impacts a second: 1 to 4 N that ring at 60 to 120 Hz and decay within 30 ms, on a press of 0.5 N."""
    events = np.concatenate(([-1.0], _events(2.0, duration_s, random)))
    peaks, rings = random.uniform(1.0, 4.0, len(events)), random.uniform(60.0, 120.0, len(events))
    last = _number(time, events) - 1
    since = time - events[last]
    return 0.5 + peaks[last] * np.exp(-since / 0.03) * np.sin(2.0 * np.pi * rings[last] * since)


SYNTHETIC: dict[str, Force] = {
    "step": _step,
    "square": _square,
    "chirp": _chirp,
    "triangle": _triangle,
    "saw": _saw,
    "texture": _texture,
    "drop_outs": _drop_outs,
    "quantised": _quantised,
    "held": _held,
    "drift": _drift,
    "spikes": _spikes,
    "switching": _switching,
    "white_noise": _white_noise,
    "turning": _turning,
    "damped_impact": _damped_impact,
}
"""By name."""
