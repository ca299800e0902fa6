"""What is coded, and that no signal is in both halves."""

from typing import get_args

import numpy as np
import pytest

from weberlink.master.trace import Trace
from weberlink.studies.adaptive.signals import CHOSEN_RECORDINGS, FULL, NOISE_N, QUICK, Half, Scope, recordings, scenes
from weberlink.studies.adaptive.work import ABLATION, EQUAL, RATES, TUNING, length, tasks
from weberlink.studies.evaluate.study import NamedTrace

TWELVE = [f"omega3_{n}" for n in (1, 13, 19, 7)] + [
    f"tue_{what}_{n}" for what in ("foam", "free", "rigid", "spring") for n in (1, 2)
]


def given(*names: str) -> list[NamedTrace]:
    time = np.arange(50.0) * 1e-3
    empty = np.zeros((50, 3))
    return [NamedTrace(name, Trace(time, empty, empty, np.zeros((0, 2)))) for name in names]


def test_halves_are_disjoint_and_make_the_whole() -> None:
    found = recordings(given(*TWELVE), FULL) + scenes(FULL, NOISE_N)
    names = {half: {source.key.name for source in found if source.key.half == half} for half in get_args(Half)}
    assert not names["chosen"] & names["reported"]
    assert names["chosen"] | names["reported"] == {source.key.name for source in found}
    assert names["chosen"] & set(TWELVE) == CHOSEN_RECORDINGS
    assert len(names["reported"] & set(TWELVE)) == 6
    seeds = {half: {source.seed for source in found if source.key.half == half} - {0} for half in get_args(Half)}
    assert seeds == {"chosen": {1}, "reported": {2, 3}}


def test_a_recording_of_anyone_else_chose_nothing() -> None:
    (source,) = recordings(given("mine"), FULL)
    assert source.key.half == "reported"


def test_all_seeds_of_a_scene_are_one_group_and_every_recording_is_its_own() -> None:
    assert {source.key.group for source in scenes(FULL, 0.0)} == set(FULL.scenes)
    assert len({source.key.group for source in recordings(given(*TWELVE), FULL)}) == 12


@pytest.mark.parametrize("scope", [FULL, QUICK])
def test_constants_are_compared_where_they_were_chosen_and_judged_elsewhere(scope: Scope) -> None:
    for task in tasks(given(*TWELVE), scope):
        if task.source.key.half == "chosen":
            assert not {ABLATION, EQUAL} & set(task.parts)
        else:
            assert TUNING not in task.parts
        assert length(task) > 0.0
    rated = [task.source.key.name for task in tasks(given(*TWELVE), scope) if RATES in task.parts]
    assert len(rated) == len(set(rated)) == 12 + len(scope.scenes) * len(scope.seeds)


def test_a_scene_is_the_same_again_and_noise_is_added_to_its_force() -> None:
    scope = QUICK._replace(duration_s=0.2)
    clean, noisy = (scenes(scope, noise, [3])[0].signal() for noise in (0.0, NOISE_N))
    assert np.array_equal(scenes(scope, 0.0, [3])[0].signal().position_m, clean.position_m)
    assert np.array_equal(clean.position_m, noisy.position_m)
    assert np.std(noisy.force_n - clean.force_n) == pytest.approx(NOISE_N, rel=0.2)
