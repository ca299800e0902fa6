"""The clairvoyant bound: never above the sends of an encoder, nor above brute force on tiny signals."""

from collections.abc import Callable
from functools import cache
from itertools import pairwise
from math import inf, pi, radians

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.optimize import linprog

from tests.examples import examples
from weberlink.codec import Channel, Encoder, force_channel
from weberlink.codec.deadband import ConeDeadband, Deadband, ForceDeadband, LevelCrossingDeadband, VelocityDeadband
from weberlink.codec.predictors import FitLimits
from weberlink.geometry.vector import Vector
from weberlink.studies import recordings
from weberlink.studies.evaluate.clairvoyant import clairvoyant_sends
from weberlink.studies.evaluate.clairvoyant.demand import sector_of
from weberlink.studies.evaluate.clairvoyant.stretch import reaches
from weberlink.studies.evaluate.replay import replay, signal_of

FAMILIES = ("zoh", "linear", "plane", "sphere", "hybrid")
Array = NDArray[np.float64]
EXACT = {"force_step": 1e-9, "position_step": 1e-12, "saturates": False}

seeds = st.integers(0, 2**32 - 1)
directions = st.sampled_from((radians(2.0), radians(20.0), radians(80.0), radians(120.0), pi))
webers = st.sampled_from((0.0, 0.025, 0.1, 0.3, 1.0))
floors = st.sampled_from((0.0, 0.02, 0.5))
cones = st.builds(ConeDeadband, webers, floors, directions)
deadbands = st.one_of(
    st.builds(ForceDeadband, webers, floors),
    cones,
    st.builds(
        LevelCrossingDeadband, webers, st.sampled_from((1e-3, 0.02, 0.5)), directions, st.sampled_from((0.0, 0.25, 1.0))
    ),
    st.builds(VelocityDeadband, webers, st.sampled_from((0.0, 0.02)), slope=st.sampled_from((0.0, 0.5, 20.0))),
)


def bounds(
    force: Array, position: Array, deadband: Deadband | float, floor: float = 0.02, **wire: object
) -> dict[str, int]:
    """The bounds of all families; a number is the Weber factor of an isotropic deadband."""
    shape = ForceDeadband(deadband, floor) if isinstance(deadband, float) else deadband
    channel = force_channel(deadband=shape, **wire)  # type: ignore[arg-type]
    found = clairvoyant_sends(force, position, channel=channel, families=FAMILIES)
    assert None not in found.values()
    return {name: sends for name, sends in found.items() if sends is not None}


def sends(force: Array, position: Array, channel: Channel) -> int:
    """The sends of the real encoder."""
    encoder = Encoder(channel)
    ticks = enumerate(zip(map(tuple, force.tolist()), map(tuple, position.tolist()), strict=True))
    return sum(encoder.encode(tick, f, p) is not None for tick, (f, p) in ticks)


def along(values: Array, axis: int = 2) -> Array:
    vectors = np.zeros((len(values), 3))
    vectors[:, axis] = values
    return vectors


# Random signals: each a function of a random generator and a number of ticks.


def steps(chance: np.random.Generator, ticks: int) -> tuple[Array, Array]:
    levels = chance.normal(0.0, 2.0, (ticks, 3)) * (chance.random((ticks, 1)) < 0.5)
    return np.repeat(levels, 7, axis=0)[:ticks], chance.normal(0.0, 0.01, (ticks, 3))


def ramps(chance: np.random.Generator, ticks: int) -> tuple[Array, Array]:
    slopes = np.repeat(chance.normal(0.0, 0.1, (ticks, 3)), 9, axis=0)[:ticks]
    return np.cumsum(slopes, axis=0), np.cumsum(chance.normal(0.0, 1e-4, (ticks, 3)), axis=0)


def motion(chance: np.random.Generator, ticks: int) -> Array:
    """A smooth path through the origin [m]."""
    rates, phases = chance.uniform(0.02, 0.3, 3), chance.uniform(0.0, 2 * pi, 3)
    return 5e-3 * np.sin(np.outer(np.arange(ticks), rates) + phases)


def plane_contact(chance: np.random.Generator, ticks: int) -> tuple[Array, Array]:
    position, normal = motion(chance, ticks), chance.normal(size=3)
    normal /= np.linalg.norm(normal)
    depth = np.maximum(0.0, -(position @ normal))
    return 10.0 ** chance.uniform(1.0, 4.0) * depth[:, None] * normal + noise(chance, ticks), position


def sphere_contact(chance: np.random.Generator, ticks: int, radius: float = 0.0) -> tuple[Array, Array]:
    """Convex and concave, the surface through the origin."""
    position, normal = motion(chance, ticks), chance.normal(size=3)
    normal /= np.linalg.norm(normal)
    radius = radius or chance.choice((-1.0, 1.0)) * chance.uniform(0.01, 0.1)
    outward = position + radius * normal
    length = np.linalg.norm(outward, axis=1)
    depth = np.maximum(0.0, radius - length if radius > 0 else length + radius)
    return 800.0 * np.sign(radius) * (depth / length)[:, None] * outward + noise(chance, ticks), position


def noise(chance: np.random.Generator, ticks: int) -> Array:
    return chance.normal(0.0, chance.choice((0.0, 1e-3, 0.1)), (ticks, 3))


def wild(chance: np.random.Generator, ticks: int) -> tuple[Array, Array]:
    """Forces and positions of all sizes, beyond the wire's range too, and none at all."""
    sizes = 10.0 ** chance.uniform(-6.0, 2.5, (ticks, 1)) * (chance.random((ticks, 1)) < 0.8)
    return sizes * chance.normal(size=(ticks, 3)), chance.normal(size=(ticks, 3)) * 10.0 ** chance.uniform(-6.0, 1.0)


KINDS: tuple[Callable[[np.random.Generator, int], tuple[Array, Array]], ...] = (
    steps,
    ramps,
    plane_contact,
    sphere_contact,
    wild,
)


@examples(120)
@given(
    kind=st.sampled_from(KINDS),
    seed=seeds,
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


def made(family: str, chance: np.random.Generator, position: Array, used: Array) -> Array:
    """Forces of a random model of the family, in the space of the axes in use."""
    if family in ("zoh", "linear"):
        slope = chance.normal(0.0, 0.02, 3) * (family == "linear")
        return (chance.normal(0.0, 2.0, 3) + slope * np.arange(len(position))[:, None]) * used
    normal, stiffness = chance.normal(size=3) * used, 10.0 ** chance.uniform(1.0, 4.0)
    normal /= np.linalg.norm(normal)
    if family == "plane":
        return stiffness * np.maximum(0.0, chance.uniform(-2e-3, 8e-3) - position @ normal)[:, None] * normal
    radius = chance.choice((-1.0, 1.0)) * 10.0 ** chance.uniform(-2.3, 0.0)
    outward = position + (radius + chance.uniform(-5e-3, 5e-3)) * normal
    length = np.linalg.norm(outward, axis=1)
    depth = np.maximum(0.0, radius - length if radius > 0 else length + radius)
    return stiffness * np.sign(radius) * (depth / length)[:, None] * outward


def turned(vector: Array, angle: Array, chance: np.random.Generator) -> Array:
    """Each by its angle, about an axis across it."""
    across = np.cross(vector, chance.normal(size=vector.shape))
    length = np.linalg.norm(across, axis=1, keepdims=True)
    axis = across / np.where(length > 0.0, length, 1.0)
    return vector * np.cos(angle)[:, None] + np.cross(axis, vector) * np.sin(angle)[:, None]


@examples(80)
@given(
    family=st.sampled_from(FAMILIES[:-1]),
    seed=seeds,
    lengths=st.lists(st.integers(1, 200), min_size=1, max_size=4),
    weber=st.sampled_from((0.0, 0.025, 0.1, 0.3, 1.0)),
    shape=st.sampled_from(((1, 1, 1), (0, 1, 1), (0, 0, 1), radians(20.0), radians(80.0))),
)
def test_no_choice_of_models_needs_less(
    family: str, seed: int, lengths: list[int], weber: float, shape: tuple[int, ...] | float
) -> None:
    """A signal of a few models, changed to anywhere within a ball (of these axes) or a cone (of this angle)."""
    chance = np.random.default_rng(seed)
    used = np.array((1, 1, 1) if isinstance(shape, float) else shape)
    position = motion(chance, sum(lengths)) * used
    parts = np.split(position, np.cumsum(lengths)[:-1])
    exact = np.concatenate([made(family, chance, part, used) for part in parts])
    share = weber / (1.0 + weber)  # of the exact force, to be within the deadband of the changed one
    if isinstance(shape, float):
        size = 1.0 + 0.999 * share * chance.uniform(-1.0, 1.0, len(exact))
        force = turned(exact * size[:, None], 0.999 * shape * chance.random(len(exact)), chance)
        found = bounds(force, position, ConeDeadband(weber, 1e-6, shape), **EXACT)
    else:
        error = chance.normal(size=exact.shape) * used
        error *= chance.random((len(exact), 1)) / np.linalg.norm(error, axis=1, keepdims=True)
        force = exact + error * np.linalg.norm(exact, axis=1, keepdims=True) * share
        found = bounds(force, position, weber, 1e-6, **EXACT)
    assert found["hybrid"] <= found[family] <= len(lengths)


# Brute force: the fewest stretches, each explained by one model as a linear program says.


def fewest(ticks: int, first: int, explained: Callable[[int, int], bool]) -> int:
    """By dynamic programming over all segmentations; `explained(a, b)`: a send at a keeps the law until b - 1."""
    need = [inf] * ticks + [0.0]
    for start in reversed(range(ticks)):
        need[start] = min(1 + need[end] for end in range(start + 1, ticks + 1) if explained(start, end))
    return int(min(need[start] for start in range(first + 1))) if first < ticks else 0


def solvable(rows: list[list[float]], most: list[float], limits: list[tuple[float | None, float | None]]) -> bool:
    if not rows:
        return True
    # The tightest of the requirements, as large as can be: feasible if it need not be negative.
    slack = [[*row, 1.0] for row in rows]
    found = linprog([0.0] * len(limits) + [-1.0], A_ub=slack, b_ub=most, bounds=[*limits, (None, 1.0)])
    assert found.status == 0
    return bool(-found.fun >= 0.0)


def brute_line(force: Array, error: Array, largest_slope: float | None) -> int:
    def explained(start: int, end: int) -> bool:
        ticks = range(start, end)
        rows = [[sign, sign * float(tick - start)] for tick in ticks for sign in (1.0, -1.0)]
        most = [sign * force[tick] + error[tick] for tick in ticks for sign in (1.0, -1.0)]
        return solvable(rows, most, [(None, None), (largest_slope and -largest_slope, largest_slope)])

    def held(start: int, end: int) -> bool:
        return bool((force - error)[start:end].max() <= (force + error)[start:end].min())

    return fewest(len(force), first_broken(force, error), held if largest_slope == 0.0 else explained)


def brute_plane(force: Array, position: Array, error: Array, stiffest: float) -> int:
    """A wall from either side: 0 <= v; f = v n, v = -s n p + b, s in [0, stiffest], the rest at rest."""

    def explained(start: int, end: int) -> bool:
        return brute_hold(start, end) or any(wall(start + 1, end, side) for side in (1.0, -1.0))

    def brute_hold(start: int, end: int) -> bool:
        return bool((force - error)[start:end].max() <= (force + error)[start:end].min())

    def wall(start: int, end: int, side: float) -> bool:
        rows, most = [], []
        for tick in range(start, end):
            if abs(force[tick]) > error[tick]:
                if side * force[tick] < 0.0:
                    return False
                # In mm, so that the program is well scaled.
                rows.append([side * position[tick] * 1e3, -1.0])
                most.append(-(side * force[tick] - error[tick]))
            rows.append([-side * position[tick] * 1e3, 1.0])
            most.append(abs(force[tick]) + error[tick])
        return solvable(rows, most, [(0.0, stiffest * 1e-3), (None, None)])

    return fewest(len(force), first_broken(force, error), explained)


def first_broken(force: Array, error: Array) -> int:
    broken = np.flatnonzero(np.abs(force) > error)
    return int(broken[0]) if len(broken) else len(force)


def line_signal(seed: int, ticks: int) -> tuple[Array, Array]:
    chance = np.random.default_rng(seed)
    position = np.cumsum(chance.normal(0.0, 1e-3, ticks))
    force = np.where(position < 0.0, -800.0 * position, 0.0) + chance.normal(0.0, chance.choice((0.03, 0.3)), ticks)
    return force, position


@examples(12)
@given(seed=seeds, ticks=st.integers(2, 12), weber=st.sampled_from((0.05, 0.2, 0.5)))
def test_one_degree_of_freedom_equals_brute_force(seed: int, ticks: int, weber: float) -> None:
    force, position = line_signal(seed, ticks)
    error = np.maximum(weber * np.abs(force), 0.02)
    found = bounds(along(force), along(position), weber, **EXACT)
    assert found["zoh"] == brute_line(force, error, 0.0)
    assert found["linear"] == brute_line(force, error, None)
    assert found["plane"] == brute_plane(force, position, error, FitLimits().stiffness[1])


@examples(30)
@given(seed=seeds, ticks=st.integers(2, 12), deadband=deadbands)
def test_holds_are_not_above_brute_force(seed: int, ticks: int, deadband: Deadband) -> None:
    """Among tried values, those that the deadband itself accepts at every tick."""
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


@examples(60)
@given(
    deadband=st.one_of(
        cones,
        st.builds(LevelCrossingDeadband, webers, st.sampled_from((1e-3, 0.5)), directions),
    ),
    seed=seeds,
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


def test_a_constant_force_is_one_send() -> None:
    still = np.zeros((50, 3))
    assert set(bounds(still + np.array((0.3, 1.0, 0.0)), still, 0.1).values()) == {1}
    assert set(bounds(still + np.array((0.01, 0.01, 0.01)), still, 0.1).values()) == {0}
    assert set(bounds(still, still, 0.0, 0.0).values()) == {0}
    assert bounds(still[:0], still[:0], 0.1) == dict.fromkeys(FAMILIES, 0)


def test_a_ramp_is_one_line_and_many_holds() -> None:
    force = along(np.linspace(1.0, 4.0, 600)) + along(np.linspace(2.0, 1.0, 600), axis=0)
    found = bounds(force, np.zeros((600, 3)), 0.05)
    assert found["linear"] == found["hybrid"] == 1
    assert found["zoh"] >= found["plane"] >= found["sphere"] > 5


def test_holds_of_a_growing_force_are_counted_by_hand() -> None:
    """A value c holds while f (1 - k) <= c <= f (1 + k): each reaches (1 + k) / (1 - k) times as far."""
    weber, ratio = 0.1, 50.0
    force = along(np.geomspace(1.0, ratio, 4001))
    found = bounds(force, np.zeros_like(force), weber, saturates=False)
    assert found["zoh"] == np.ceil(np.log(ratio) / np.log((1 + weber) / (1 - weber)))


@pytest.mark.parametrize("normal", [(0.0, 0.0, 1.0), (0.6, 0.0, 0.8), (2 / 3, -2 / 3, 1 / 3)])
def test_a_plane_is_one_send_however_it_is_touched(normal: tuple[float, float, float]) -> None:
    ticks = np.arange(2000)
    position = 5e-3 * np.column_stack((np.sin(0.013 * ticks), np.cos(0.007 * ticks), np.sin(0.02 * ticks)))
    depth = np.maximum(0.0, -(position @ np.array(normal)))
    found = bounds(500.0 * depth[:, None] * normal, position, 0.05)
    assert found["plane"] == found["sphere"] == found["hybrid"] == 1
    assert found["zoh"] > 50
    assert found["linear"] > 10


@pytest.mark.parametrize("radius", [0.02, -0.02])
def test_a_sphere_needs_fewer_sends_than_a_plane(radius: float) -> None:
    chance = np.random.default_rng(3)
    force, position = np.zeros((0, 3)), np.zeros((0, 3))
    while len(force) == 0 or np.linalg.norm(force, axis=1).max() < 1.0:
        force, position = sphere_contact(chance, 1500, radius)
    size = np.linalg.norm(force, axis=1)
    force = force * (size > 0.02)[:, None]
    found = bounds(force, position, 0.2)
    assert found["hybrid"] <= found["sphere"] < found["plane"] < found["zoh"]


def test_a_stiffness_outside_the_limits_is_no_plane() -> None:
    position = along(-1e-3 * (1.0 + np.sin(0.05 * np.arange(400))))
    force = -2000.0 * position
    assert bounds(force, position, 0.05)["plane"] == 1
    assert bounds(force, position, 0.05, fit_limits=FitLimits(stiffness=(10.0, 1500.0)))["plane"] > 1


def test_two_opposite_walls_are_one_hollow_sphere() -> None:
    position = along(6e-3 * np.sin(0.02 * np.arange(1500)))
    force = -600.0 * np.sign(position) * np.maximum(np.abs(position) - 2e-3, 0.0)
    found = bounds(force, position, 0.1)
    assert found["sphere"] == 1
    # Five half-periods, each pressed once.
    assert found["plane"] == 10


def test_models_may_exceed_the_wire_where_it_saturates() -> None:
    depth = np.concatenate((np.linspace(1e-3, 6e-3, 300), np.full(100, 6e-3)))
    found = bounds(along(np.concatenate((np.linspace(20.0, 60.0, 300), np.full(100, 60.0)))), along(-depth), 0.0, 0.0)
    assert found["linear"] == found["hybrid"] == 1 < found["zoh"]
    found = bounds(along(1e4 * depth), along(-depth), 0.0, 0.0)
    assert found["plane"] == found["sphere"] == 1 < found["zoh"]
    # One axis saturates and turns the force.
    found = bounds(np.outer(1e4 * depth, (0.6, 0.0, 0.8)), np.outer(depth, (-0.6, 0.0, -0.8)), 0.0, 0.0)
    assert found["plane"] == found["sphere"] == 1 < found["zoh"]


@pytest.mark.parametrize("jointly", [True, False])
@pytest.mark.parametrize("resolution", [4, 16, 200])
@pytest.mark.parametrize("seed", range(2))
def test_stretches_reach_as_far_as_all_their_pairs_allow(jointly: bool, resolution: int, seed: int) -> None:
    """Of two lines through gates, against every stretch by itself; on a grid of time, a little further."""
    low, high, exact = gates(seed)
    ticks = low.shape[1]

    def pair(earlier: Array, later: Array, distance: int) -> tuple[Array, Array]:
        return (low[:, later] - high[:, earlier]) / distance, (high[:, later] - low[:, earlier]) / distance

    exact = exact.min(axis=0, keepdims=True) if jointly else exact
    any_slope = np.full((2, ticks), inf)
    found = reaches(-any_slope, any_slope, pair, jointly=jointly, resolution=resolution)
    assert (found >= exact).all()
    assert (np.diff(found, axis=1) >= 0).all()
    within = exact - np.arange(ticks) <= 2 * resolution
    assert (found[within] == exact[within]).all()
    assert within.all() == (resolution == 200)


@cache
def gates(seed: int) -> tuple[Array, Array, Array]:
    """Two rows of gates, lower and upper ends, and where each stretch ends."""
    chance, ticks = np.random.default_rng(seed), 400
    middle = np.cumsum(np.cumsum(chance.normal(0.0, 1e-3, (2, ticks)), axis=1), axis=1)
    width = np.repeat(chance.uniform(0.01, 0.4, ticks // 50), 50)
    low, high = middle - width, middle + width
    return low, high, np.array([line_reaches(*row) for row in zip(low, high, strict=True)])


def line_reaches(low: Array, high: Array) -> Array:
    """Of each start, the first tick that no line from there on passes, by the slopes between any two of its gates."""
    ticks = len(low)
    least, most, found = np.full(ticks, -inf), np.full(ticks, inf), np.full(ticks, ticks)
    for start in reversed(range(ticks)):
        later, distance = slice(start + 1, None), np.arange(1, ticks - start)
        least[later] = np.maximum(least[later], (low[later] - high[start]) / distance)
        most[later] = np.minimum(most[later], (high[later] - low[start]) / distance)
        broken = np.maximum.accumulate(least[later]) > np.minimum.accumulate(most[later])
        if broken.any():
            found[start] = start + 1 + np.argmax(broken)
    return found


@pytest.mark.parametrize("kind", KINDS[:-1])
@pytest.mark.parametrize("used", [(1, 1, 1), (0, 0, 1)])
def test_a_wider_deadband_never_needs_more(kind: Callable[..., tuple[Array, Array]], used: tuple[int, ...]) -> None:
    force, position = kind(np.random.default_rng(11), 400)
    rows = [bounds(force * used, position * used, weber) for weber in (0.0, 0.05, 0.1, 0.2, 0.4)]
    for narrow, wide in pairwise(rows):
        assert all(wide[family] <= narrow[family] for family in FAMILIES)
    assert rows[-1]["zoh"] < rows[0]["zoh"]


def test_a_family_is_asked_for_by_name_and_alone() -> None:
    force, position = plane_contact(np.random.default_rng(5), 300)
    channel = force_channel(bank=("zoh", "plane"))
    every = clairvoyant_sends(force, position, channel=channel, families=FAMILIES)
    for family in FAMILIES:
        alone = clairvoyant_sends(force, position, channel=channel, families=[family])
        assert alone == {family: every[family]}
    # Of this bank, a hybrid is no more than its planes.
    assert every["hybrid"] == every["plane"]
    # Of a family that is not known here nothing is said.
    assert clairvoyant_sends(force, position, channel=channel, families=["cubic", "zoh"]) == {
        "cubic": None,
        "zoh": every["zoh"],
    }


def test_a_turning_force_is_one_hold_in_a_cone() -> None:
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
def test_no_bound_where_sends_change_the_deadband(reference: str) -> None:
    force = along(np.linspace(1.0, 2.0, 50))
    for deadband in (ForceDeadband(0.1, 0.02, reference), VelocityDeadband(0.1, 0.02, reference)):  # type: ignore[arg-type]
        channel = force_channel(deadband=deadband)
        assert clairvoyant_sends(force, force, channel=channel, families=["zoh", "hybrid"]) == {
            "zoh": None,
            "hybrid": None,
        }


@pytest.mark.parametrize("name", ["tue_spring_1", "omega3_19"])
def test_recordings_need_more_than_a_clairvoyant(name: str) -> None:
    trace = recordings.load(name)
    found = bounds(trace.force_n, trace.position_m, 0.1)
    for family in FAMILIES:
        real = len(replay(signal_of(trace), force_channel(predictor=family, weber=0.1)).updates)
        assert 0 < found[family] <= real
