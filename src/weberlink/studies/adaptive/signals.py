"""What the study codes, and which half of it chose the parameters of `adaptive`.

A signal is a recording or a scene explored with one seed. All seeds of a scene are one group: what they have in common
is more than what tells them apart, so that confidence must come from other groups.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal, NamedTuple

from weberlink.studies.evaluate.replay import Signal, signal_of
from weberlink.studies.evaluate.scenes import scene_names, scene_signal
from weberlink.studies.evaluate.study import NamedTrace

Half = Literal["chosen", "reported"]
Kind = Literal["recording", "scene"]

CHOSEN_RECORDINGS = frozenset({"omega3_1", "omega3_19", "tue_foam_1", "tue_free_1", "tue_rigid_1", "tue_spring_1"})
"""Parameters were chosen on these; any other recording is reported on."""
CHOSEN_SEED = 1
"""And on the scenes explored with this seed; any other is reported on."""
NOISE_N = 2e-3
"""Of a force sensor, RMS per axis."""
RUBBED_AND_MOVED = ("plane_friction", "sphere_friction", "plane_moving")
"""Scenes of which a target of its own is set."""


class Key(NamedTuple):
    """What is said of a signal beside its numbers."""

    name: str
    group: str
    half: Half
    kind: Kind
    noise_n: float
    """Added to the force; 0 for recordings, whose noise is their own."""


@dataclass(frozen=True)
class Source:
    """Where a signal comes from.

    Args:
        key: what it is called.
        recorded: of a recording; None for a scene.
        seed: of a scene.
        duration_s: likewise.
    """

    key: Key
    recorded: Signal | None = None
    seed: int = 0
    duration_s: float = 0.0

    def signal(self) -> Signal:
        """Simulated on the first call in a process."""
        if self.recorded is not None:
            return self.recorded
        return _explored(self.key.group, self.seed, self.duration_s, self.key.noise_n)

    @property
    def ticks(self) -> int:
        return len(self.recorded) if self.recorded is not None else round(self.duration_s * 1000.0)


class Scope(NamedTuple):
    """How much is looked at.

    Args:
        scenes: names.
        seeds: of all scenes.
        more_seeds: of all scenes, looked at for packets alone.
        duration_s: of a scene.
        ticks: of a recording, from its middle, at most.
        floors_n: of the deadband; the first is that of everything but the first comparison.
        smoothings: length of the ramp [ticks] and share of the deadband.
        limits: whether the clairvoyant bound is worked out.
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


FULL = Scope(scene_names())
QUICK = Scope(
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


def recordings(given: Iterable[NamedTrace], scope: Scope) -> list[Source]:
    """Those of people."""
    return [
        Source(Key(name, name, "chosen" if name in CHOSEN_RECORDINGS else "reported", "recording", 0.0), recorded)
        for name, trace in given
        if len(recorded := signal_of(trace).middle(scope.ticks))
    ]


def scenes(scope: Scope, noise_n: float, seeds: Sequence[int] | None = None) -> list[Source]:
    """Those of `scope`, with its seeds unless others are named."""
    return [
        Source(
            Key(
                f"{name}, seed {seed}", name, "chosen" if seed == CHOSEN_SEED else "reported", "scene",
                noise_n,
            ),
            seed=seed,
            duration_s=scope.duration_s,
        )
        for name in scope.scenes
        for seed in (scope.seeds if seeds is None else seeds)
    ]  # fmt: skip


@lru_cache(maxsize=4)
def _explored(name: str, seed: int, duration_s: float, noise_n: float) -> Signal:
    return scene_signal(name, seed, duration_s, noise_n)
