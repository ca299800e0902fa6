"""The clairvoyant bound with every shape of the deadband: never above an encoder, nor above what models could do."""

from collections.abc import Callable
from math import pi, radians

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from tests.examples import examples
from tests.studies.evaluate.test_clairvoyant import EXACT, KINDS, along, fewest, known, made, motion, sends
from weberlink.codec import force_channel
from weberlink.codec.deadband import ConeDeadband, Deadband, ForceDeadband, LevelCrossingDeadband, VelocityDeadband
from weberlink.geometry.vector import Vector
from weberlink.studies.evaluate.clairvoyant import clairvoyant_sends
from weberlink.studies.evaluate.clairvoyant.sector import sector_of

FAMILIES = ("zoh", "linear", "plane", "sphere", "hybrid")
Array = NDArray[np.float64]

directions = st.sampled_from((radians(2.0), radians(20.0), radians(80.0), radians(120.0), pi))
webers = st.sampled_from((0.0, 0.025, 0.1, 0.3, 1.0))
deadbands = st.one_of(
    st.builds(ConeDeadband, webers, st.sampled_from((0.0, 0.02, 0.5)), directions),
    st.builds(
        LevelCrossingDeadband, webers, st.sampled_from((1e-3, 0.02, 0.5)), directions, st.sampled_from((0.0, 0.25, 1.0))
    ),
    st.builds(VelocityDeadband, webers, st.sampled_from((0.0, 0.02)), slope=st.sampled_from((0.0, 0.5, 20.0))),
)


def bounds(force: Array, position: Array, deadband: Deadband, **wire: object) -> dict[str, int]:
    channel = force_channel(deadband=deadband, **wire)  # type: ignore[arg-type]
    return known(clairvoyant_sends(force, position, channel=channel, families=FAMILIES))


@examples(200)
@given(
    kind=st.sampled_from(KINDS),
    seed=st.integers(0, 2**32 - 1),
    ticks=st.integers(1, 200),
    deadband=deadbands,
    axes=st.sampled_from(("xyz", "z", "xz")),
    used=st.sampled_from(((1, 1, 1), (0, 0, 1), (0, 1, 1))),
    exact=st.booleans(),
)
def test_no_encoder_sends_less(
    kind: Callable[[np.random.Generator, int], tuple[Array, Array]],
    seed: int,
    ticks: int,
    deadband: Deadband,
    axes: str,
    used: tuple[int, int, int],
    exact: bool,
) -> None:
    force, position = kind(np.random.default_rng(seed), ticks)
    force, position = force * used, position * used
    wire = {"axes": axes, **(EXACT if exact else {})}
    found = bounds(force, position, deadband, **wire)
    for family in FAMILIES:
        channel = force_channel(predictor=family, deadband=deadband, **wire)  # type: ignore[arg-type]
        assert found[family] <= sends(force, position, channel), family
    assert found["hybrid"] <= min(found.values())
    assert found["zoh"] >= max(found.values())


def turned(vector: Array, angle: Array, chance: np.random.Generator) -> Array:
    """Each by its angle, about an axis across it."""
    across = np.cross(vector, chance.normal(size=vector.shape))
    length = np.linalg.norm(across, axis=1, keepdims=True)
    axis = across / np.where(length > 0.0, length, 1.0)
    return vector * np.cos(angle)[:, None] + np.cross(axis, vector) * np.sin(angle)[:, None]


@examples(100)
@given(
    family=st.sampled_from(FAMILIES[:-1]),
    seed=st.integers(0, 2**32 - 1),
    lengths=st.lists(st.integers(1, 200), min_size=1, max_size=4),
    weber=st.sampled_from((0.025, 0.1, 0.3)),
    direction=st.sampled_from((radians(20.0), radians(80.0))),
)
def test_no_choice_of_models_needs_less(
    family: str, seed: int, lengths: list[int], weber: float, direction: float
) -> None:
    """A signal made of a few models, to anywhere within the cone: longer or shorter, and turned."""
    chance, used = np.random.default_rng(seed), np.ones(3)
    position = motion(chance, sum(lengths))
    parts = np.split(position, np.cumsum(lengths)[:-1])
    exact = np.concatenate([made(family, chance, part, used) for part in parts])
    # A share of the magnitude of the force that results.
    size = 1.0 + 0.999 * weber / (1.0 + weber) * chance.uniform(-1.0, 1.0, len(exact))
    force = turned(exact * size[:, None], 0.999 * direction * chance.random(len(exact)), chance)
    found = bounds(force, position, ConeDeadband(weber, 1e-6, direction), **EXACT)
    assert found["hybrid"] <= found[family] <= len(lengths)


@examples(25)
@given(seed=st.integers(0, 2**32 - 1), ticks=st.integers(2, 12), deadband=deadbands)
def test_holds_are_not_above_brute_force(seed: int, ticks: int, deadband: Deadband) -> None:
    """Of values that are tried, those that the deadband itself accepts at every tick."""
    chance = np.random.default_rng(seed)
    force = np.cumsum(chance.normal(0.0, 0.15, (ticks, 3)), axis=0) + 1.0
    position = np.zeros((ticks, 3))
    forces: list[Vector] = [(x, y, z) for x, y, z in force.tolist()]

    def accepts(displayed: Vector, tick: int) -> bool:
        return deadband.error(displayed, forces[tick]) <= deadband.bound(forces[tick], displayed, displayed, 0.0)

    def held(start: int, end: int) -> bool:
        part = force[start:end]
        middle = part.mean(axis=0)
        tried = [middle, middle * np.linalg.norm(part, axis=1).mean() / np.linalg.norm(middle), *part]
        return any(all(accepts((x, y, z), tick) for tick in range(start, end)) for x, y, z in map(tuple, tried))

    first = next((tick for tick in range(ticks) if not accepts((0.0, 0.0, 0.0), tick)), ticks)
    assert bounds(force, position, deadband, **EXACT)["zoh"] <= fewest(ticks, first, held)


@examples(200)
@given(
    deadband=st.one_of(
        st.builds(ConeDeadband, webers, st.sampled_from((0.0, 0.02, 0.5)), directions),
        st.builds(LevelCrossingDeadband, webers, st.sampled_from((1e-3, 0.5)), directions),
    ),
    seed=st.integers(0, 2**32 - 1),
)
def test_a_sector_holds_all_that_the_deadband_accepts(
    deadband: ConeDeadband | LevelCrossingDeadband, seed: int
) -> None:
    chance = np.random.default_rng(seed)
    size = 10.0 ** chance.uniform(-3.0, 1.0)
    force: Vector = tuple((size * unit(chance)).tolist())
    sector = sector_of(deadband, [force], force_channel(**EXACT).value_quantizer, collinear=False)  # type: ignore[arg-type]
    w = np.array([unit(chance) for _ in range(13)])
    highest = sector.extent((w @ np.array(force))[:, None], np.array([size]))[:, 0]
    bound = deadband.bound(force, force, force, 0.0)
    near = turned(np.tile(np.array(force), (400, 1)), chance.uniform(0.0, pi, 400) ** 2 / pi, chance)
    tried = near * (1.0 + chance.normal(0.0, 0.3, (400, 1)))
    for g in tried:
        held = (float(g[0]), float(g[1]), float(g[2]))
        if deadband.error(held, force) <= bound:
            assert (w @ g <= highest).all()
            assert sector.radius[0] >= np.linalg.norm(g - force)


def unit(chance: np.random.Generator) -> Array:
    vector: Array = chance.normal(size=3)
    return vector / np.linalg.norm(vector)


# Signals whose bound is known.


def test_on_one_axis_a_cone_is_a_ball() -> None:
    chance = np.random.default_rng(3)
    force, position = along(np.cumsum(chance.normal(0.0, 0.1, 500))), along(np.cumsum(chance.normal(0.0, 1e-4, 500)))
    assert bounds(force, position, ConeDeadband(0.1, 0.02)) == bounds(force, position, ForceDeadband(0.1, 0.02))


def test_a_force_that_turns_is_one_hold_of_a_wide_cone() -> None:
    angle = radians(30.0) * np.sin(0.02 * np.arange(1000))
    force = 5.0 * np.column_stack((np.sin(angle), np.zeros(1000), np.cos(angle)))
    still = np.zeros((1000, 3))
    assert bounds(force, still, ConeDeadband(0.1, 0.02, radians(31.0)))["zoh"] == 1
    assert bounds(force, still, ConeDeadband(0.1, 0.02, radians(12.0)))["zoh"] > 2
    assert bounds(force, still, ForceDeadband(0.1, 0.02))["zoh"] > 5


def test_a_growing_force_crosses_levels_that_can_be_counted() -> None:
    """A hold on a level counts for what is on either side of it: every second level."""
    levels, ratio = LevelCrossingDeadband(0.1, 0.1, 1.0, 0.0), 1.1**20
    force = along(np.geomspace(1.0 + 1e-9, ratio * (1.0 - 1e-9), 4001))
    assert bounds(force, np.zeros_like(force), levels, **EXACT)["zoh"] == 10
    wider = LevelCrossingDeadband(0.1, 0.1, 1.0, 0.25)
    # A quarter of the spacing more at both ends is not yet another level.
    assert bounds(force, np.zeros_like(force), wider, **EXACT)["zoh"] == 10


def test_a_fast_hand_needs_less() -> None:
    force = along(1.0 + 0.5 * np.sin(0.05 * np.arange(2000)))
    still, moving = np.zeros((2000, 3)), along(1e-3 * np.arange(2000.0), axis=0)
    deadband = VelocityDeadband(0.05, 0.02, slope=0.5, most=0.25)
    slow, fast = (bounds(force, each, deadband)["zoh"] for each in (still, moving))
    assert slow == bounds(force, still, ForceDeadband(0.05, 0.02))["zoh"]
    assert fast < slow
    # At the first tick nothing is known of the hand's speed.
    assert fast - bounds(force, still, ForceDeadband(0.25, 0.02))["zoh"] in (0, 1)


@pytest.mark.parametrize("reference", ["displayed", "sent"])
def test_nothing_is_said_of_what_depends_on_what_was_sent(reference: str) -> None:
    force = along(np.linspace(1.0, 2.0, 50))
    for deadband in (ForceDeadband(0.1, 0.02, reference), VelocityDeadband(0.1, 0.02, reference)):  # type: ignore[arg-type]
        channel = force_channel(deadband=deadband)
        assert clairvoyant_sends(force, force, channel=channel, families=["zoh", "hybrid"]) == {
            "zoh": None,
            "hybrid": None,
        }
