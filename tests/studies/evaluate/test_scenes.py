"""Signals of simulated scenes: charts, the random motion, and the forces of the surfaces."""

import re
from functools import cache
from itertools import pairwise
from math import pi
from pathlib import Path
from random import Random

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.examples import examples
from weberlink.geometry.vector import distance
from weberlink.slave.scenes.settings import build
from weberlink.studies.evaluate.exploration import ExploredSurface, exploration, home
from weberlink.studies.evaluate.replay import Array, Signal
from weberlink.studies.evaluate.scenes import (
    HOLLOW_M,
    RADIUS_M,
    SCENES,
    ball,
    bowl,
    level,
    scene_names,
    scene_signal,
)

CENTER = (0.01, -0.02, 0.03)
LENGTHS = st.floats(-0.04, 0.04)
DURATION_S = 5.0


@examples(40)
@given(u=LENGTHS, v=LENGTHS, above=st.floats(-0.02, 0.02))
def test_above_is_the_distance_from_the_surface(u: float, v: float, above: float) -> None:
    assert level(0.01)((u, v, above)) == pytest.approx((u, v, 0.01 + above))
    assert distance(ball(CENTER, 0.05)((u, v, above)), CENTER) == pytest.approx(0.05 + above)
    assert distance(bowl(CENTER, 0.05)((u, v, above)), CENTER) == pytest.approx(0.05 - above)


def test_u_and_v_are_lengths_along_the_surface() -> None:
    quarter = 0.05 * pi / 2.0
    assert ball(CENTER, 0.05)((0.0, 0.0, 0.001)) == pytest.approx((0.01, -0.02, 0.081))
    assert bowl(CENTER, 0.05)((0.0, 0.0, 0.001)) == pytest.approx((0.01, -0.02, -0.019))
    assert ball(CENTER, 0.05)((quarter, 0.0, 0.0)) == pytest.approx((0.06, -0.02, 0.03))
    assert bowl(CENTER, 0.05)((0.0, -quarter, 0.0)) == pytest.approx((0.01, -0.07, 0.03))


@pytest.mark.parametrize("chart", [level(0.0), ball((0.0, 0.0, -0.05), 0.05)])
def test_each_leg_begins_where_the_last_one_ended(chart) -> None:
    surface = ExploredSurface(chart, 0.04, 0.005, (0.7, 4.5))
    legs = exploration(surface, 20.0, Random(3))
    assert sum(leg.duration for leg in legs) > 20.0
    assert distance(legs[0].at(0.0), home(surface)) == 0.0
    for one, other in pairwise(legs):
        assert one.at(1.0) == pytest.approx(other.at(0.0), abs=1e-12)


@pytest.mark.parametrize("seed", range(2))
def test_motion_is_that_of_a_hand(seed: int) -> None:
    touched, samples = 0, 40
    for leg in exploration(ExploredSurface(level(0.0), 0.04, 0.005, (0.7, 4.5)), 60.0, Random(seed)):
        places = [leg.at(i / samples) for i in range(samples + 1)]
        for x, y, z in places:
            assert max(abs(x), abs(y)) < 0.055
            assert -0.005 * 4.5 <= z <= 0.0201
            touched += z < 0.0
        for one, other in pairwise(places):
            assert distance(one, other) * samples / leg.duration < 0.5
    assert touched > 1000


@cache
def signal(name: str) -> Signal:
    return scene_signal(name, 1, DURATION_S)


def force_of(name: str) -> Array:
    return np.asarray(np.linalg.norm(signal(name).force_n, axis=1))


@pytest.mark.parametrize("name", scene_names())
def test_a_hand_explores(name: str) -> None:
    one, force = signal(name), force_of(name)
    assert one.force_n.shape == one.position_m.shape == (5000, 3)
    assert np.isfinite(one.force_n).all()
    touching = force > 0.0
    assert 0.3 < touching.mean() < 0.99
    assert 0.5 < np.median(force[touching]) < 5.0
    assert force.max() < 12.0
    assert np.abs(one.position_m).max() < 0.06
    assert 0.05 < np.linalg.norm(np.diff(one.position_m, axis=0), axis=1).max() / 1e-3 < 1.0


def test_a_seed_determines_every_bit() -> None:
    one, same, other = (scene_signal("height_field", seed, 1.0) for seed in (4, 4, 5))
    assert np.array_equal(one.force_n, same.force_n)
    assert np.array_equal(one.position_m, same.position_m)
    assert not np.array_equal(one.position_m, other.position_m)


def test_each_scene_has_its_own_motion() -> None:
    sphere, plane = (scene_signal(name, 1, 1.0) for name in ("sphere", "plane"))
    assert not np.array_equal(sphere.position_m, plane.position_m)
    with pytest.raises(KeyError):
        scene_signal("spoon", 1)


def test_the_forces_are_those_of_the_surfaces() -> None:
    plane, sphere, cavity, moving = (signal(name) for name in ("plane", "sphere", "sphere_cavity", "plane_moving"))
    assert plane.force_n[:, 2] == pytest.approx(500.0 * np.maximum(0.0, -plane.position_m[:, 2]), abs=1e-9)
    depth = RADIUS_M - np.linalg.norm(sphere.position_m - np.array((0.0, 0.0, -RADIUS_M)), axis=1)
    assert force_of("sphere") == pytest.approx(800.0 * np.maximum(0.0, depth), abs=1e-3)
    depth = np.linalg.norm(cavity.position_m - np.array((0.0, 0.0, HOLLOW_M)), axis=1) - HOLLOW_M
    assert force_of("sphere_cavity") == pytest.approx(600.0 * np.maximum(0.0, depth), abs=1e-3)
    surface = 0.016 * np.sin(2.0 * pi * np.arange(len(moving)) * 1e-3)
    assert moving.force_n[:, 2] == pytest.approx(500.0 * np.maximum(0.0, surface - moving.position_m[:, 2]), abs=1e-6)


def test_the_hand_yields_to_the_felt_force() -> None:
    assert signal("plane").position_m[:, 2].min() < -0.004
    assert -0.004 < signal("stiff_plane").position_m[:, 2].min() < -0.0005


@pytest.mark.parametrize("name", ["plane_friction", "plane_sliding", "sphere_friction"])
def test_friction_reaches_the_limit_of_its_cone(name: str) -> None:
    one = signal(name)
    normal = np.array((0.0, 0.0, 1.0))
    if name == "sphere_friction":
        outward = one.position_m - np.array((0.0, 0.0, -RADIUS_M))
        normal = outward / np.linalg.norm(outward, axis=1)[:, None]
    pressing = (one.force_n * normal).sum(axis=1)
    rubbing = np.linalg.norm(one.force_n - pressing[:, None] * normal, axis=1)
    pressed = pressing > 0.1
    ratio = rubbing[pressed] / pressing[pressed]
    assert ratio.max() <= 0.3 * (1.0 + 1e-3)
    assert (ratio > 0.29).mean() > 0.1


def test_a_moving_plane_presses_a_resting_hand() -> None:
    scene = build([SCENES["plane_moving"].object])
    scene.force((0.0, 0.0, 0.03), 0.0)
    forces = [scene.force((0.0, 0.0, -0.02), 1e-3)[2] for _ in range(1000)]
    assert max(forces) == pytest.approx(500.0 * 0.036, rel=1e-3)
    assert min(forces) == pytest.approx(500.0 * 0.004, rel=1e-3)
    sliding = np.abs(signal("plane_sliding").force_n)
    assert sliding[:, 0].mean() > 2.0 * sliding[:, 1].mean()


def test_sensor_noise_does_not_change_the_motion() -> None:
    clean, noisy = signal("plane"), scene_signal("plane", 1, DURATION_S, noise_n=2e-3)
    assert np.array_equal(clean.position_m, noisy.position_m)
    noise = noisy.force_n - clean.force_n
    assert noise.std(axis=0) == pytest.approx([2e-3] * 3, rel=0.05)
    assert noise.mean(axis=0) == pytest.approx([0.0] * 3, abs=1e-4)


def test_the_documentation_lists_every_signal() -> None:
    page = (Path(__file__).parents[3] / "docs" / "scenes.md").read_text(encoding="utf-8")
    table = page.split("| signal |", 1)[1].split("\n\n", 1)[0]
    assert re.findall(r"^\| `(\w+)` \|", table, re.M) == list(scene_names())


@pytest.mark.parametrize("name", ["plane_velocity_friction", "plane_texture", "plane_changing"])
def test_an_effect_is_not_that_of_the_object_alone(name: str) -> None:
    one = signal(name)
    alone = 500.0 * np.maximum(0.0, -one.position_m[:, 2])
    pressed = alone > 0.5
    along, swing = np.linalg.norm(one.force_n[pressed, :2], axis=1), one.force_n[pressed, 2] / alone[pressed]
    if name == "plane_velocity_friction":
        assert swing == pytest.approx(1.0)
        coefficient = along / alone[pressed]
        assert 0.3 < coefficient.max() < 1.5
        assert np.quantile(coefficient, 0.1) < 0.5 * np.quantile(coefficient, 0.9)
    elif name == "plane_texture":
        assert along.max() == 0.0
        assert (swing.min(), swing.max()) == pytest.approx((0.85, 1.15), abs=1e-3)
    else:
        assert set(swing.round(6)) == {1.0, 2.0}
