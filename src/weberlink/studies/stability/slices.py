"""The slices of the stability map: which cells it has."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import product
from typing import Any

from weberlink.studies.stability.cells import SystemCell, lightly_damped

WALLS = (500.0, 1e4, 1e7)
"""Stiffnesses [N/m] of a soft wall, a rigid one and the stiffest of all."""

TRIPS = (0.0, 0.02, 0.1, 0.7, 1.0)
ALL_TRIPS = (0.0, 0.002, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 0.7, 1.0)
"""Round trips [s]."""

BAD_LINK: dict[str, float] = {"jitter_s": 0.01, "loss": 0.3}

Robots = tuple[dict[str, Any], ...]
POINT: Robots = ({"robot": "point"},)
MASSES: Robots = tuple(
    {"robot": "simulated", "robot_mass_kg": mass, "robot_damping_n_s_m": damping}
    for mass in (0.005, 1.0)
    for damping in (None, lightly_damped(mass))
)

CONTACTS: tuple[tuple[str, dict[str, Any]], ...] = (
    ("ball", {"contact": "ball"}),
    ("box", {"contact": "box"}),
    ("friction 0.3", {"friction": 0.3}),
    ("friction 0.5", {"friction": 0.5}),
    ("damping 1 N s/m", {"wall_damping_n_s_m": 1.0}),
    ("damping 3 N s/m", {"wall_damping_n_s_m": 3.0}),
    ("both, hybrid", {"friction": 0.3, "wall_damping_n_s_m": 1.0, "predictor": "hybrid"}),
    ("moving, 0.1 m/s", {"wall_speed_m_s": 0.1}),
)

FAR: dict[str, Any] = {"round_trip_s": 0.1}
EXTREMES: tuple[tuple[str, dict[str, Any]], ...] = (
    ("hand 1 mg", {"mass_kg": 1e-6} | FAR),
    ("hand 1 t", {"mass_kg": 1e3} | FAR),
    ("hand 1e6 N s/m", {"damping_n_s_m": 1e6} | FAR),
    ("robot 1 mg", {"robot": "simulated", "robot_mass_kg": 1e-6, "stiffness_n_m": 1e7} | FAR),
    ("robot 1 t", {"robot": "simulated", "robot_mass_kg": 1e3, "stiffness_n_m": 1e7} | FAR),
    ("robot 1e6 N s/m", {"robot": "simulated", "robot_damping_n_s_m": 1e6} | FAR),
    ("wall 1e-3 N/m", {"stiffness_n_m": 1e-3} | FAR),
    ("wall 1e9 N/m", {"stiffness_n_m": 1e9} | FAR),
    ("10 Hz", {"rate_hz": 10.0, "stiffness_n_m": 1e4} | FAR),
    ("10 kHz", {"rate_hz": 1e4, "stiffness_n_m": 1e7} | FAR),
    ("wall at 5 m/s", {"wall_speed_m_s": 5.0} | FAR),
    ("2 s, 30 % lost", {"round_trip_s": 2.0, "jitter_s": 0.1, "loss": 0.3, "stiffness_n_m": 1e7}),
)
"""One parameter at the end of its range each. Delay makes each of them harder."""


def cells(seed: int, *, full: bool) -> list[SystemCell]:
    """All cells of the map.

    Args:
        seed: of every link.
        full: every slice in fine steps, instead of the most telling ones.
    """
    return [replace(cell, seed=seed) for cell in (_every() if full else _telling())]


def _telling() -> Iterator[SystemCell]:
    rigid = (1e7,)
    yield from _walls("none", POINT, WALLS, (0.0, 0.02, 0.1))
    yield from _walls("bounded", POINT, WALLS, TRIPS)
    yield from _walls("bounded", POINT, (500.0, 1e7), (0.0, 0.7), **BAD_LINK)
    yield from _walls("bounded", MASSES, rigid, (0.0, 0.1, 0.7))
    yield from _hands(rigid, (0.0, 0.1))
    yield from _contacts((1e4,), (0.0, 0.1, 0.7))
    yield from _extremes(("bounded",))


def _every() -> Iterator[SystemCell]:
    yield from _walls("none", POINT, _decades(10.0, 1e7, 2), ALL_TRIPS, predictor="zoh")
    yield from _walls("none", POINT, _decades(10.0, 1e7, 2), ALL_TRIPS)
    yield from _walls("bounded", POINT + MASSES, (100.0, 500.0, *_decades(1e3, 1e7, 1)), ALL_TRIPS)
    yield from _walls("bounded", POINT + MASSES, (500.0, *_decades(1e3, 1e7, 1)), ALL_TRIPS, **BAD_LINK)
    yield from _hands((500.0, 1e3, 1500.0, 2e3, 1e4, 1e7), ALL_TRIPS)
    yield from _contacts((500.0, 1e4, 1e6), (0.0, 0.02, 0.1, 0.7))
    yield from _extremes(("none", "bounded"))
    yield from _rate((100.0, 250.0, 500.0, 1000.0, 2000.0, 4000.0), _decades(100.0, 1e5, 2))
    yield from _masses(_decades(0.001, 10.0, 2), _decades(0.05, 50.0, 2))
    yield from _loss((0.0, 0.002, 0.01, 0.05), (0.0, 0.02, 0.1, 0.3), (0.0, 0.02, 0.1, 0.3, 0.7, 1.0))
    yield from _other_hands()
    yield from _weber((0.0, 0.025, 0.05, 0.1, 0.2, 0.3, 0.5), (0.0, 0.02, 0.1, 0.3, 1.0))


def _walls(
    scheme: str, robots: Robots, stiffnesses: Sequence[float], trips: tuple[float, ...], **others: Any
) -> Iterator[SystemCell]:
    for robot, stiffness, trip in product(robots, stiffnesses, trips):
        yield SystemCell("walls", scheme, stiffness_n_m=stiffness, round_trip_s=trip, **robot, **others)


def _hands(stiffnesses: tuple[float, ...], trips: tuple[float, ...]) -> Iterator[SystemCell]:
    grips: tuple[Any, ...] = ("firm", "pinch", "fingertip")
    for grip, stiffness in product(grips, stiffnesses):
        yield replace(_uncoded("hands"), grip=grip, stiffness_n_m=stiffness)
    for trip, grip, stiffness in product(trips, grips, stiffnesses):
        yield SystemCell("hands", grip=grip, stiffness_n_m=stiffness, round_trip_s=trip)


def _contacts(stiffnesses: tuple[float, ...], trips: tuple[float, ...]) -> Iterator[SystemCell]:
    for stiffness, (case, contact), trip in product(stiffnesses, CONTACTS, trips):
        # Friction and motion of an object are in the models of this predictor alone.
        cell = SystemCell("contacts", case=case, **{"predictor": "surface"} | contact)
        yield replace(cell, stiffness_n_m=stiffness, round_trip_s=trip)


def _extremes(schemes: tuple[str, ...]) -> Iterator[SystemCell]:
    for (case, parameters), scheme in product(EXTREMES, schemes):
        yield SystemCell("extremes", scheme, case=case, **parameters)


def _uncoded(name: str) -> SystemCell:
    """A cell without coding, where the limits of the sampled wall hold."""
    return SystemCell(name, "none", "zoh", "zoh", weber=0.0, floor_n=0.0, bound_m=0.0)


def _masses(masses: list[float], dampings: list[float]) -> Iterator[SystemCell]:
    for mass, damping in product(masses, dampings):
        yield replace(_uncoded("masses"), mass_kg=mass, damping_n_s_m=damping)


def _rate(rates: tuple[float, ...], stiffnesses: list[float]) -> Iterator[SystemCell]:
    for rate, stiffness in product(rates, stiffnesses):
        yield replace(_uncoded("rates"), rate_hz=rate, stiffness_n_m=stiffness)


def _loss(jitters: tuple[float, ...], losses: tuple[float, ...], trips: tuple[float, ...]) -> Iterator[SystemCell]:
    for jitter, loss, trip in product(jitters, losses, trips):
        yield SystemCell("loss", round_trip_s=trip, jitter_s=jitter, loss=loss)


def _other_hands() -> Iterator[SystemCell]:
    """Other hands and rates with a delayed, lossy link under control."""
    hands = product((0.001, 0.03, 1.0, 10.0), (0.5, 8.0, 50.0))
    for (mass, damping), rate, stiffness in product(hands, (100.0, 1000.0, 4000.0), (500.0, 1e7)):
        cell = SystemCell("far hands", round_trip_s=0.1, jitter_s=0.01, loss=0.1)
        yield replace(cell, mass_kg=mass, damping_n_s_m=damping, rate_hz=rate, stiffness_n_m=stiffness)


def _weber(webers: tuple[float, ...], trips: tuple[float, ...]) -> Iterator[SystemCell]:
    for weber, trip in product(webers, trips):
        yield SystemCell("weber", weber=weber, round_trip_s=trip)


def _decades(first: float, last: float, each: int) -> list[float]:
    """Values from first to last, `each` per decade, rounded to two digits."""
    values, value = [], first
    while value < last * 1.001:
        values.append(float(f"{value:.2g}"))
        value *= 10.0 ** (1.0 / each)
    return values
