import re
from functools import cache
from math import pi
from pathlib import Path

import numpy as np
import pytest

from weberlink.geometry.vector import Vector
from weberlink.slave.scenes.settings import build
from weberlink.studies.evaluate.replay import Array, Signal
from weberlink.studies.evaluate.scenes import HOLLOW_M, RADIUS_M, SCENES, scene_names, scene_signal, scene_signals

DURATION_S = 10.0


@cache
def signal(name: str, seed: int = 1) -> Signal:
    return scene_signal(name, seed, DURATION_S)


def force_of(name: str) -> Array:
    return np.asarray(np.linalg.norm(signal(name).force_n, axis=1))


def depth_in_ball(position: Array, center: Vector) -> Array:
    return np.asarray(RADIUS_M - np.linalg.norm(position - np.array(center), axis=1))


@pytest.mark.parametrize("name", scene_names())
def test_a_hand_explores(name: str) -> None:
    """Contact most of the time, but not for good; forces of a fingertip, speeds of a hand."""
    one, force = signal(name), force_of(name)
    assert one.force_n.shape == one.position_m.shape == (10_000, 3)
    assert one.period_s == 1e-3
    assert np.isfinite(one.force_n).all()
    assert np.isfinite(one.position_m).all()
    touching = force > 0.0
    assert 0.3 < touching.mean() < 0.99
    assert (np.diff(touching.astype(int)) < 0).sum() >= 1
    assert 0.5 < np.median(force[touching]) < 5.0
    assert force.max() < 12.0
    assert np.abs(one.position_m).max() < 0.06
    assert 0.05 < np.linalg.norm(np.diff(one.position_m, axis=0), axis=1).max() / 1e-3 < 1.0


@pytest.mark.parametrize("name", ["plane_friction", "height_field", "plane_moving"])
def test_a_seed_is_a_motion_bit_for_bit(name: str) -> None:
    one, same, other = scene_signal(name, 4, 2.0), scene_signal(name, 4, 2.0), scene_signal(name, 5, 2.0)
    assert np.array_equal(one.force_n, same.force_n)
    assert np.array_equal(one.position_m, same.position_m)
    assert not np.array_equal(one.position_m, other.position_m)


def test_all_scenes_or_some_each_with_a_motion_of_its_own() -> None:
    assert list(scene_signals(1, 0.5)) == list(scene_names())
    some = scene_signals(1, 2.0, names=("sphere", "plane"))
    assert list(some) == ["sphere", "plane"]
    assert not np.array_equal(some["sphere"].position_m, some["plane"].position_m)
    with pytest.raises(KeyError):
        scene_signal("spoon", 1)


def test_the_forces_are_those_of_the_surfaces() -> None:
    plane, sphere, cavity = signal("plane"), signal("sphere"), signal("sphere_cavity")
    assert plane.force_n[:, 2] == pytest.approx(500.0 * np.maximum(0.0, -plane.position_m[:, 2]), abs=1e-9)
    depth = np.maximum(0.0, depth_in_ball(sphere.position_m, (0.0, 0.0, -RADIUS_M)))
    assert force_of("sphere") == pytest.approx(800.0 * depth, abs=1e-3)
    depth = np.linalg.norm(cavity.position_m - np.array((0.0, 0.0, HOLLOW_M)), axis=1) - HOLLOW_M
    assert force_of("sphere_cavity") == pytest.approx(600.0 * np.maximum(0.0, depth), abs=1e-3)


def test_the_hand_yields_to_what_it_feels() -> None:
    """It means to be centimetres deep for the forces that it wants, and a stiff surface stops it after millimetres."""
    assert signal("plane").position_m[:, 2].min() < -0.004
    assert -0.004 < signal("stiff_plane").position_m[:, 2].min() < -0.0005


@pytest.mark.parametrize("name", ["plane_friction", "plane_sliding", "sphere_friction"])
def test_friction_stays_in_its_cone_and_often_reaches_it(name: str) -> None:
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


def test_a_moving_plane_changes_the_force_on_a_hand_that_holds_still() -> None:
    scene = build([SCENES["plane_moving"].thing])
    scene.force((0.0, 0.0, 0.03), 0.0)
    forces = [scene.force((0.0, 0.0, -0.02), 1e-3)[2] for _ in range(1000)]
    assert max(forces) == pytest.approx(500.0 * 0.036, rel=1e-3)
    assert min(forces) == pytest.approx(500.0 * 0.004, rel=1e-3)
    assert max(abs(np.diff(forces))) / 1e-3 / 500.0 == pytest.approx(0.1, rel=0.01)  # [m/s]


def test_a_moving_plane_is_where_its_motion_says_at_each_tick() -> None:
    one = signal("plane_moving")
    surface = 0.016 * np.sin(2.0 * pi * np.arange(len(one)) * 1e-3)
    assert one.force_n[:, 2] == pytest.approx(500.0 * np.maximum(0.0, surface - one.position_m[:, 2]), abs=1e-6)


def test_a_sliding_plane_drags_along_a_hand_that_rests() -> None:
    rest, sliding = signal("plane_friction").force_n, signal("plane_sliding").force_n
    assert np.abs(sliding[:, 0]).mean() > np.abs(sliding[:, 1]).mean()
    assert np.abs(sliding[:, 0]).mean() > np.abs(rest[:, 0]).mean()


def test_a_noisy_sensor_changes_no_motion() -> None:
    clean, noisy = signal("plane"), scene_signal("plane", 1, DURATION_S, noise_n=2e-3)
    assert np.array_equal(clean.position_m, noisy.position_m)
    noise = noisy.force_n - clean.force_n
    assert noise.std(axis=0) == pytest.approx([2e-3] * 3, rel=0.05)
    assert noise.mean(axis=0) == pytest.approx([0.0] * 3, abs=1e-4)
    assert np.array_equal(noisy.force_n, scene_signal("plane", 1, DURATION_S, noise_n=2e-3).force_n)


def test_the_documentation_lists_every_signal() -> None:
    page = (Path(__file__).parents[4] / "docs" / "scenes.md").read_text(encoding="utf-8")
    table = page.split("| signal |", 1)[1].split("\n\n", 1)[0]
    assert re.findall(r"^\| `(\w+)` \|", table, re.M) == list(scene_names())
