"""The mixture of surfaces: conservative between changes, and no change costs more energy than allowed."""

from dataclasses import replace
from itertools import pairwise
from math import ceil, cos, inf, sin

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from tests.control.vectors import vectors
from tests.control.walls import Ball, Wall
from weberlink.codec.predictors.surface import SurfacePatch
from weberlink.control.contract import WallModel
from weberlink.control.force_port import STEEPEST
from weberlink.control.model import LEAST_WEIGHT, MOST_SURFACES, RISE_SPEED, SurfaceMixture
from weberlink.geometry.vector import ZERO, Vector, distance, norm, subtract

TICK = 1e-3
stiffnesses = st.floats(10.0, 3000.0)
surfaces = st.one_of(
    st.builds(Wall, stiffnesses, st.floats(-0.02, 0.02)),
    st.builds(Ball, stiffnesses, st.tuples(st.floats(-0.01, 0.01), st.floats(-0.01, 0.01), st.floats(-0.06, -0.03))),
)
hands = vectors(0.03)
changes = st.lists(
    st.tuples(st.one_of(st.none(), surfaces), hands, st.integers(0, 30), st.floats(-0.1, 0.5)), max_size=8
)
Change = tuple[WallModel | None, Vector, int, float]


def changed(course: list[Change], most: float = inf) -> SurfaceMixture:
    """A mixture after these changes, each with its surface, hand, duration in ticks and spare energy."""
    mixture = SurfaceMixture(most)
    for surface, hand, ticks, spare in course:
        mixture.follow(0.0, hand)
        mixture.want(surface)
        for _ in range(ticks):
            mixture.turn(TICK, spare)
    return mixture


def felt(mixture: SurfaceMixture, hand: Vector) -> tuple[Vector, float]:
    """Force [N] and stored energy [J] with the hand there."""
    mixture.follow(0.0, hand)
    return mixture.force, mixture.stored


@given(changes, st.lists(hands, min_size=2, max_size=6))
def test_work_around_a_closed_path_is_zero(course: list[Change], corners: list[Vector]) -> None:
    """On the way to free space it takes energy: what fades out gives way, and comes back no more."""
    mixture, work, pieces = changed(course), 0.0, 400
    for start, end in pairwise([*corners, corners[0]]):
        way = subtract(end, start)
        force, _ = felt(mixture, start)
        for piece in range(1, pieces + 1):
            share = piece / pieces
            then, _ = felt(mixture, (start[0] + share * way[0], start[1] + share * way[1], start[2] + share * way[2]))
            work += sum(0.5 * (f + g) * d / pieces for f, g, d in zip(force, then, way, strict=True))
            force = then
    step = 0.11 / pieces
    rounding = len(corners) * 4.0 * 3000.0 * step * step * MOST_SURFACES
    assert work <= rounding
    assert work >= -rounding or None in [surface for surface, *_ in course]


@given(changes, st.one_of(st.none(), surfaces), hands, hands, st.floats(-0.1, 0.5))
def test_a_change_stores_no_more_than_there_is_to_spare(
    course: list[Change], surface: WallModel | None, wanted_at: Vector, hand: Vector, spare: float
) -> None:
    mixture = changed(course)
    mixture.follow(0.0, wanted_at)
    mixture.want(surface)
    for _ in range(3):
        _, before = felt(mixture, hand)
        mixture.turn(TICK, spare)
        _, after = felt(mixture, hand)
        assert after - before <= max(0.0, spare) + 1e-12


@given(changes, hands)
def test_it_presses_no_harder_and_stores_no_more_than_one_of_its_surfaces(course: list[Change], hand: Vector) -> None:
    """The sum of the weights is at most 1."""
    force, stored = felt(changed(course), hand)
    alone = [(norm(surface.at(0.0, hand)), surface.stiffness) for surface, *_ in course if surface is not None]
    assert norm(force) <= max((pressed for pressed, _ in alone), default=0.0) * (1.0 + 1e-9)
    most = max((0.5 * pressed * pressed / stiffness for pressed, stiffness in alone), default=0.0)
    assert 0.0 <= stored <= most * (1.0 + 1e-9)


@given(changes, surfaces, hands)
def test_wanting_changes_no_force_by_itself(course: list[Change], surface: WallModel, hand: Vector) -> None:
    assume(len(course) < MOST_SURFACES)
    mixture = changed(course)
    before, _ = felt(mixture, hand)
    mixture.follow(0.0, hand)
    mixture.want(surface)
    assert felt(mixture, hand)[0] == pytest.approx(before)


@given(changes, surfaces, hands)
def test_with_energy_to_spare_it_becomes_what_is_wanted(course: list[Change], surface: WallModel, hand: Vector) -> None:
    mixture = changed(course)
    mixture.follow(0.0, hand)
    mixture.want(surface)
    for _ in range(2000):
        mixture.turn(TICK, 1.0)
    assert mixture.newest is not None
    assert mixture.newest.surface == surface
    force, stored = felt(mixture, hand)
    wanted = surface.at(0.0, hand)
    assert distance(force, wanted) <= 1e-6
    assert stored == pytest.approx(0.5 * norm(wanted) ** 2 / surface.stiffness, abs=1e-8)


@given(changes, hands)
def test_free_space_is_reached_whatever_is_owed(course: list[Change], hand: Vector) -> None:
    mixture = changed(course)
    mixture.follow(0.0, hand)
    mixture.want(None)
    for _ in range(300):
        mixture.turn(TICK, -1.0)
    assert mixture.newest is None
    assert felt(mixture, hand) == (ZERO, 0.0)


@given(surfaces, surfaces, hands)
def test_what_takes_energy_is_turned_into_even_in_debt(first: WallModel, second: WallModel, hand: Vector) -> None:
    mixture = changed([(first, hand, 2000, 1.0)])
    _, stored = felt(mixture, hand)
    mixture.follow(0.0, hand)
    mixture.want(second)
    slewing = norm(subtract(first.at(0.0, hand), second.at(0.0, hand))) / (STEEPEST * TICK)
    for _ in range(100 + ceil(slewing)):
        mixture.turn(TICK, -1.0)
    force, after = felt(mixture, hand)
    assert after <= stored + 1e-12
    pressed, wanted = norm(first.at(0.0, hand)), norm(second.at(0.0, hand))
    if wanted <= pressed and wanted**2 / second.stiffness < 0.9 * pressed**2 / first.stiffness:
        assert distance(force, second.at(0.0, hand)) <= 0.01 * pressed + 1e-6


@pytest.mark.parametrize("ticks", [3, 10, 30, 100])
def test_updates_in_quick_succession_do_not_wear_the_wall_away(ticks: int) -> None:
    """With more surfaces than it may hold, each with little weight, the force is that of all of them."""
    hand = (0.0, 0.0, -0.01)
    mixture = changed([(Wall(500.0), hand, 1000, 1.0)])
    for number in range(1, 60):
        mixture.follow(0.0, hand)
        mixture.want(Wall(500.0, 1e-6 * number))
        for _ in range(ticks):
            mixture.turn(TICK, 1.0)
            assert norm(felt(mixture, hand)[0]) >= 0.85 * 5.0


@given(changes, st.one_of(st.none(), surfaces), hands)
def test_a_change_slews_the_force(course: list[Change], surface: WallModel | None, hand: Vector) -> None:
    mixture = changed(course)
    mixture.follow(0.0, hand)
    mixture.want(surface)
    rise = 0.0 if surface is None else RISE_SPEED * TICK * surface.stiffness
    before = mixture.force
    mixture.turn(TICK, 1.0)
    # A surface whose weight falls below the least one is dropped.
    left = LEAST_WEIGHT * sum(norm(one.at(0.0, hand)) for one, *_ in course if one is not None)
    assert distance(mixture.force, before) <= STEEPEST * TICK + rise + left + 1e-9


def test_friction_takes_energy_around_any_path_and_across_changes() -> None:
    patch = SurfacePatch((0.0, 0.0, 1.0), (0.0, 0.0, 0.0), 0, 500.0, friction=0.5)
    mixture, hand = SurfaceMixture(), (0.0, 0.0, -0.005)
    mixture.follow(0.0, hand)
    mixture.want(patch)
    for _ in range(300):
        mixture.turn(TICK, 1.0)
    begun = mixture.stored
    work, angle = 0.0, 0.0
    for tick in range(4000):
        if tick % 500 == 250:
            mixture.want(replace(patch, friction=0.3 if tick % 1000 == 250 else 0.5))
            assert mixture.newest is not None
            assert mixture.newest.memory != patch.point  # the god-object that the hand has dragged along is kept
        force, angle = mixture.force, angle + 0.002
        then = (0.01 * sin(angle), 0.01 * (1.0 - cos(angle)), -0.005)
        work -= sum(f * (b - a) for f, a, b in zip(force, hand, then, strict=True))
        hand = then
        mixture.follow(0.0, hand)
        mixture.turn(TICK, 0.0)
    assert work - (mixture.stored - begun) >= 0.3 * 2.5 * 4000 * 0.002 * 0.01 * 0.9


@pytest.mark.parametrize("speed", [1e-4, -1e-4])
def test_a_surface_that_moves_does_its_work_on_the_hand(speed: float) -> None:
    """Carried along with it, the hand takes out what the motion puts in."""
    patch = SurfacePatch((0.0, 0.0, 1.0), (0.0, 0.0, 0.0), 0, 500.0, velocity=speed)
    mixture = SurfaceMixture()
    mixture.follow(0.0, (0.0, 0.0, -0.005))
    mixture.want(patch)
    for _ in range(300):
        mixture.turn(TICK, 1.0)
    supplied = sum(mixture.follow(float(tick), (0.0, 0.0, speed * tick - 0.005)) for tick in range(1, 101))
    assert supplied == pytest.approx(2.5 * 100 * speed, rel=1e-6)
    assert mixture.force == pytest.approx((0.0, 0.0, 2.5))


@pytest.mark.parametrize("follower", [None, Wall(500.0, -0.1)], ids=["free space", "another surface"])
def test_a_surface_that_was_replaced_moves_no_more(follower: WallModel | None) -> None:
    """Its motion was fitted to samples that newer ones have replaced; extrapolated it presses ever harder."""
    hand = (0.0, 0.0, -0.005)
    mixture = SurfaceMixture()
    mixture.follow(0.0, hand)
    mixture.want(SurfacePatch((0.0, 0.0, 1.0), ZERO, 0, 500.0, velocity=1e-4, acceleration=1e-5))
    for _ in range(300):
        mixture.turn(TICK, 1.0)
    mixture.follow(10.0, hand)
    mixture.want(follower)
    before, _ = mixture.force, mixture.turn(TICK, 0.0)
    for tick in range(11, 400):
        assert mixture.follow(float(tick), hand) == 0.0
        assert mixture.force[2] <= before[2]
        before = mixture.force
        mixture.turn(TICK, 0.0)
    assert mixture.force == ZERO


def test_what_is_not_wanted_goes_although_what_is_cannot_be_paid() -> None:
    """A surface that the hand comes back to later must not be one that was replaced long ago."""
    aside, inside = (0.2, 0.0, -0.02), (0.0, 0.0, -0.1)
    mixture = changed([(Ball(centre=(0.2, 0.02, -0.05)), aside, 1000, 1.0), (Wall(2000.0), aside, 5, 1.0)])
    mixture.follow(0.0, inside)
    for _ in range(500):
        mixture.turn(TICK, -1.0)
    newest = mixture.newest
    assert newest is not None
    assert felt(mixture, aside)[0] == newest.weighted(newest.weight)


def test_what_fades_out_presses_no_harder_on_a_hand_that_sinks_into_it() -> None:
    mixture = changed([(Wall(2500.0), (0.0, 0.0, 0.01), 100, 1.0)])
    mixture.follow(0.0, (0.0, 0.0, -0.003))
    mixture.want(None)
    before = norm(mixture.force)
    for tick in range(1, 60):
        mixture.turn(TICK, 0.0)
        mixture.follow(0.0, (0.0, 0.0, -0.003 - 0.001 * tick))
        assert norm(mixture.force) <= max(0.0, before - 0.5 * STEEPEST * TICK) + 1e-9
        before = norm(mixture.force)
    assert before == 0.0


def test_of_what_is_too_strong_to_be_displayed_nothing_has_to_fade() -> None:
    hand, most = (0.0, 0.0, -0.1), 10.0
    mixture = changed([(Wall(500.0), (0.0, 0.0, 0.01), 100, 1.0)], most)
    mixture.follow(0.0, hand)
    assert norm(mixture.force) == pytest.approx(50.0)
    mixture.want(None)
    for _ in range(ceil(most / (STEEPEST * TICK)) + 1):
        mixture.turn(TICK, 0.0)
    assert mixture.force == ZERO


def test_a_course_of_changes_makes_a_mixture() -> None:
    """Otherwise the laws above would be tested in free space only."""
    hand = (0.0, 0.0, -0.01)
    walls = [Wall(500.0, 0.001 * number) for number in range(4)]
    force, stored = felt(changed([(wall, hand, 15, 0.5) for wall in walls]), hand)
    assert 0.1 < norm(force) < norm(walls[-1].at(0.0, hand))
    assert stored > 0.0
