"""Signals of the study at any tick rate, in groups that are reported apart: recordings, scenes and synthetic forces."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal, NamedTuple
from zlib import crc32

import numpy as np

from weberlink.studies.evaluate.replay import Array, Signal
from weberlink.studies.evaluate.scenes import scene_signal
from weberlink.studies.evaluate.synthetic import synthetic_names, synthetic_signal
from weberlink.studies.evaluate.traces import FILES, NamedTrace

Kind = Literal["recording", "scene", "synthetic"]
SYNTHETIC = "synthetic"
NOISE_N = 2e-3
"""Noise of a good force sensor, RMS per axis [N]."""
LOUD_N = 20e-3
"""Noise of one in a wrist."""
RATES_HZ = (500, 1000, 4000)
BASE_HZ = 1000


class SceneGroup(NamedTuple):
    """Scenes that are reported together; `noise_n` [N] is that of the force sensor, RMS per axis."""

    name: str
    scenes: tuple[str, ...]
    noise_n: float = NOISE_N


SCENE_GROUPS = (
    SceneGroup(
        "still scenes", ("plane", "sphere", "sphere_cavity", "box", "height_field", "stiff_plane", "soft_plane")
    ),
    SceneGroup("scenes with friction", ("plane_friction", "sphere_friction")),
    SceneGroup("moving scenes", ("plane_moving", "plane_sliding")),
    SceneGroup("scenes, noise 20 mN", ("plane", "sphere", "plane_friction", "sphere_friction"), LOUD_N),
    SceneGroup("friction by speed", ("plane_velocity_friction", "sphere_velocity_friction")),
    SceneGroup("texture", ("plane_texture", "sphere_texture")),
    SceneGroup("changing stiffness", ("plane_changing", "sphere_changing")),
)
"""The last three share no model of contact with a predictor."""


class AdaptiveScope(NamedTuple):
    """How much the study covers.

    Args:
        rates_hz: tick rates; recordings and scenes are interpolated.
        groups: of scenes.
        seeds: of the scenes.
        scene_s: length of a scene.
        synthetic: names of synthetic signals.
        synthetic_s: length of each.
        recording_s: of a recording, from its middle, at most.
        fast_s: length of each signal above `BASE_HZ`, at most.
        fast_signals: number of recordings of each group, and of seeds, above `BASE_HZ`.
    """

    rates_hz: tuple[int, ...] = RATES_HZ
    groups: tuple[SceneGroup, ...] = SCENE_GROUPS
    seeds: tuple[int, ...] = (1, 2)
    scene_s: float = 8.0
    synthetic: tuple[str, ...] = synthetic_names()
    synthetic_s: float = 6.0
    recording_s: float = 60.0
    fast_s: float = 4.0
    fast_signals: tuple[int, int] = (3, 1)


FULL = AdaptiveScope()
QUICK = AdaptiveScope(
    rates_hz=(500, 1000),
    groups=(SCENE_GROUPS[1], SCENE_GROUPS[5]),
    seeds=(1,),
    scene_s=1.5,
    synthetic=("step", "texture"),
    synthetic_s=1.0,
    recording_s=1.0,
)


@dataclass(frozen=True)
class StudySignal:
    """A signal that can be made at any rate, in any process.

    Args:
        name: different for every signal.
        group: reported together.
        source: of a recording; otherwise the kind.
        kind: of signal.
        label: of the scene or synthetic signal.
        seed: of a scene or synthetic signal.
        noise_n: added to the force of a scene, RMS per axis [N].
        longest_s: the part from the middle that is used.
        recording: of a recording.
    """

    name: str
    group: str
    source: str
    kind: Kind
    label: str = ""
    seed: int = 0
    noise_n: float = 0.0
    longest_s: float = 60.0
    recording: NamedTrace | None = None

    def at(self, rate_hz: int, longest_s: float) -> Signal:
        """The signal at a tick rate, at most so many seconds from its middle."""
        length = min(self.longest_s, longest_s)
        if self.kind == "synthetic":
            return synthetic_signal(self.label, self.seed, length, 1.0 / rate_hz)
        if self.recording is not None:
            trace = self.recording.trace
            found = resampled(trace.time_s, np.hstack((trace.force_n, trace.position_m)), rate_hz)
        else:
            found = _sensed(self.label, self.seed, self.longest_s, rate_hz, self.noise_n)
        return found.middle(round(length * rate_hz))


def resampled(time_s: Array, values: Array, rate_hz: int) -> Signal:
    """Linear interpolation at a regular rate, without a filter; lost samples are filled.

    Args:
        time_s: rising, shape (n,) [s].
        values: force and position, shape (n, 6).
        rate_hz: of the result.
    """
    count = int((time_s[-1] - time_s[0]) * rate_hz + 1e-6) + 1
    times = time_s[0] + np.arange(count) / rate_hz
    columns = np.column_stack([np.interp(times, time_s, column) for column in values.T])
    return Signal(columns[:, :3], columns[:, 3:], 1.0 / rate_hz)


def signals(given: Iterable[NamedTrace], scope: AdaptiveScope) -> list[StudySignal]:
    """All signals, group by group."""
    found = [
        StudySignal(one.name, group_of(one), one.source, "recording", longest_s=scope.recording_s, recording=one)
        for one in given
    ]
    for group in scope.groups:
        found += [
            StudySignal(
                f"{scene}, seed {seed}, {1e3 * group.noise_n:g} mN", group.name, "scene", "scene", scene, seed,
                group.noise_n, scope.scene_s,
            )
            for scene in group.scenes
            for seed in scope.seeds
        ]  # fmt: skip
    found += [
        StudySignal(name, SYNTHETIC, SYNTHETIC, "synthetic", name, 1, longest_s=scope.synthetic_s)
        for name in scope.synthetic
    ]
    return found


def tasks(found: Sequence[StudySignal], scope: AdaptiveScope) -> list["SignalTask"]:
    """Every signal at every rate that the study covers."""
    work: list[SignalTask] = []
    for rate in scope.rates_hz:
        fast = rate > BASE_HZ
        counts: dict[str, int] = {}
        for one in found:
            counts[one.group] = counts.get(one.group, 0) + 1
            if fast and one.kind == "recording" and counts[one.group] > scope.fast_signals[0]:
                continue
            if fast and one.kind == "scene" and one.seed not in scope.seeds[: scope.fast_signals[1]]:
                continue
            work.append(SignalTask(one, rate, scope.fast_s if fast else one.longest_s))
    return work


class SignalTask(NamedTuple):
    """A signal at one rate, at most so many seconds of it."""

    signal: StudySignal
    rate_hz: int
    longest_s: float


def group_of(one: NamedTrace) -> str:
    """Recordings of one kind: the name without its number; all files together."""
    head, _, number = one.name.rpartition("_")
    return head if number.isdigit() and one.source != FILES else one.source


@lru_cache(maxsize=4)
def _explored(scene: str, seed: int, duration_s: float) -> Signal:
    return scene_signal(scene, seed, duration_s)


def _sensed(scene: str, seed: int, duration_s: float, rate_hz: int, noise_n: float) -> Signal:
    """A scene at a tick rate; the noise is drawn for every sample of that rate."""
    clean = _explored(scene, seed, duration_s)
    times: Array = np.arange(len(clean)) * np.float64(clean.period_s)
    found = resampled(times, np.hstack((clean.force_n, clean.position_m)), rate_hz)
    noise = np.random.default_rng([crc32(scene.encode()), seed]).normal(0.0, noise_n, found.force_n.shape)
    return Signal(found.force_n + noise, found.position_m, found.period_s)
