"""`adaptive` keeps up with the best of the paper's four on signals that no predictor models, whichever that is."""

from collections.abc import Callable

import numpy as np
import pytest

from plugins.predictors.tests.signals import Array
from tests.codec.law import make_channel, sends
from tests.codec.signals import Stream
from weberlink.codec import force_channel
from weberlink.codec.choice import Hybrid

SECONDS = 2.0
Random = np.random.Generator
FOUR = Hybrid.bank("force")


def press(time: Array, random: Random) -> Array:
    """A press of 0.5 to 3.5 N that changes slowly."""
    first, second = random.uniform(0.0, 2.0 * np.pi, 2)
    return np.asarray(2.0 + np.sin(np.pi * time + first) + 0.5 * np.sin(2.6 * np.pi * time + second))


def texture(time: Array, random: Random) -> Array:
    """A press with a vibration whose frequency wanders from 50 to 250 Hz."""
    wander = 150.0 * time - 100.0 / np.pi * np.cos(np.pi * time + random.uniform(0.0, 2.0 * np.pi))
    return press(time, random) * (1.0 + 0.15 * np.sin(2.0 * np.pi * wander))


def white_noise(time: Array, random: Random) -> Array:
    """A press with noise of 50 mN on each axis."""
    return np.outer(press(time, random), (0.0, 0.0, 1.0)) + random.normal(0.0, 0.05, (len(time), 3))


def turning(time: Array, random: Random) -> Array:
    """A force of 2 N that turns twice a second in a random plane."""
    frame, _ = np.linalg.qr(random.normal(size=(3, 3)))
    return 2.0 * (np.outer(np.cos(4.0 * np.pi * time), frame[0]) + np.outer(np.sin(4.0 * np.pi * time), frame[1]))


Force = Callable[[Array, Random], Array]


@pytest.mark.parametrize(
    ("force", "per_s"),
    [(white_noise, 1000), (turning, 1000), (texture, 500)],
    ids=lambda each: getattr(each, "__name__", None),
)
def test_it_sends_no_more_than_the_best_of_the_paper_s_four(force: Force, per_s: int) -> None:
    """Within 5 % or five updates; the hand moves independently of the force."""
    random, time = np.random.default_rng(1), np.arange(round(SECONDS * per_s)) / per_s
    found = force(time, random)
    if found.ndim == 1:
        direction = random.normal(size=3)
        found = np.outer(found, direction / np.linalg.norm(direction))
    waves = np.sin(2.0 * np.pi * (time[:, None, None] * random.uniform(0.2, 2.0, (3, 3)) + random.uniform(size=(3, 3))))
    places = 4e-3 * waves.sum(axis=2)
    stream: Stream = list(zip(map(tuple, found.tolist()), map(tuple, places.tolist()), strict=True))
    adaptive, *four = (
        sends(make_channel(predictor, tick_period=1.0 / per_s), stream) for predictor in ("adaptive", *FOUR)
    )
    assert adaptive <= max(1.05 * min(four), min(four) + 5), dict(zip(FOUR, four, strict=True))


def test_at_the_onset_of_a_contact_it_sends_no_more_than_a_plane() -> None:
    """All candidates are suspended then, so only their present errors tell which of them describes the contact."""
    depths = [1e-4 * max(0.0, tick - 100.5) for tick in range(180)]
    stream = [((0.0, 0.0, 500.0 * depth), (0.0, 0.0, -depth)) for depth in depths]
    adaptive, plane = (sends(force_channel(predictor=predictor), stream) for predictor in ("adaptive", "plane"))
    assert adaptive <= plane + 1
