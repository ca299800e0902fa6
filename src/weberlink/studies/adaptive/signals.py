"""Signals of the study: a tuning half, on which the parameters of `adaptive` were chosen, and a held-out half.

A signal is a recording, or a scene explored with one seed. Seeds of one scene are similar, so all of them form one
group of the bootstrap.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal, NamedTuple

from weberlink.studies.evaluate.replay import Signal, signal_of
from weberlink.studies.evaluate.scenes import scene_names, scene_signal
from weberlink.studies.evaluate.traces import NamedTrace

Half = Literal["chosen", "reported"]
"""The tuning half, on which parameters were chosen, and the held-out half, on which everything is reported."""
Kind = Literal["recording", "scene"]

CHOSEN_RECORDINGS = frozenset({"omega3_1", "omega3_19", "tue_foam_1", "tue_free_1", "tue_rigid_1", "tue_spring_1"})
"""Recordings of the tuning half; any other recording is held out."""
CHOSEN_SEED = 1
"""Seed of the scenes of the tuning half; any other seed is held out."""
NOISE_N = 2e-3
"""Noise of a force sensor, RMS per axis [N]."""
FRICTION_AND_MOTION = {
    "plane_friction": "plane with friction 0.3",
    "sphere_friction": "sphere with friction 0.3",
    "plane_moving": "plane moving at up to 0.1 m/s, 1 Hz",
}
"""Scenes that have a target of their own."""


class SignalKey(NamedTuple):
    """Name and class of a signal; `noise_n` [N] is added to the force of a scene (0 for recordings)."""

    name: str
    group: str
    half: Half
    kind: Kind
    noise_n: float


@dataclass(frozen=True)
class SignalSource:
    """Where a signal comes from: a recording, or a scene with its seed and duration [s]."""

    key: SignalKey
    recorded: Signal | None = None
    seed: int = 0
    duration_s: float = 0.0

    def signal(self) -> Signal:
        """The signal; a scene is simulated on the first call in a process."""
        if self.recorded is not None:
            return self.recorded
        return _explored(self.key.group, self.seed, self.duration_s, self.key.noise_n)

    @property
    def ticks(self) -> int:
        return len(self.recorded) if self.recorded is not None else round(self.duration_s * 1000.0)


class AdaptiveScope(NamedTuple):
    """How much the study covers.

    Args:
        scenes: names.
        seeds: of all scenes.
        more_seeds: of all scenes, coded for packets alone.
        duration_s: of a scene.
        ticks: of a recording, from its middle, at most.
        floors_n: absolute thresholds; all but the first comparison use the first of them.
        smoothings: length of the ramp [ticks] and share of the deadband.
        limits: whether to compute the clairvoyant bound.
        cost_ticks: of each signal whose run time is measured.
    """

    scenes: tuple[str, ...]
    seeds: tuple[int, ...] = (1, 2, 3)
    more_seeds: tuple[int, ...] = (4, 5)
    duration_s: float = 20.0
    ticks: int = 1_000_000
    floors_n: tuple[float, ...] = (0.02, 0.05)
    smoothings: tuple[tuple[int, float], ...] = ((10, 0.4), (10, 0.8), (30, 0.4), (30, 0.8))
    limits: bool = True
    cost_ticks: int = 4000


FULL = AdaptiveScope(scene_names())
QUICK = AdaptiveScope(
    ("plane_friction", "plane_moving"),
    seeds=(1, 2),
    more_seeds=(),
    duration_s=1.6,
    ticks=1200,
    floors_n=(0.02,),
    smoothings=((10, 0.8),),
    limits=False,
    cost_ticks=300,
)


def recordings(given: Iterable[NamedTrace], scope: AdaptiveScope) -> list[SignalSource]:
    """Sources of the recordings that are not empty."""
    return [
        SignalSource(SignalKey(name, name, _half(name in CHOSEN_RECORDINGS), "recording", 0.0), recorded)
        for name, trace, _ in given
        if len(recorded := signal_of(trace).middle(scope.ticks))
    ]


def scenes(scope: AdaptiveScope, noise_n: float, seeds: Sequence[int] | None = None) -> list[SignalSource]:
    """Sources of the scenes, with the seeds of `scope` unless others are given."""
    return [
        SignalSource(
            SignalKey(f"{name}, seed {seed}", name, _half(seed == CHOSEN_SEED), "scene", noise_n),
            seed=seed,
            duration_s=scope.duration_s,
        )
        for name in scope.scenes
        for seed in (scope.seeds if seeds is None else seeds)
    ]


def _half(chosen: bool) -> Half:
    return "chosen" if chosen else "reported"


@lru_cache(maxsize=4)
def _explored(name: str, seed: int, duration_s: float, noise_n: float) -> Signal:
    return scene_signal(name, seed, duration_s, noise_n)
