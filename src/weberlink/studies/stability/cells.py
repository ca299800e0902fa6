"""Cells of the stability map: the parameters of whole systems, and the motion that all of them perform."""

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import product
from math import ceil, pi, sqrt
from typing import Any

from weberlink.studies.stability.wall import SampledWall, bisect, bracket, gain_limit, passivity_limit

HEIGHT = 0.01
"""Start of the hand above the wall [m]."""

LONG_TRIPS = (0.0, 0.02, 0.1, 0.7)
COARSE_TRIPS = {"none": (0.0, 0.02, 0.1), "mmt": (*LONG_TRIPS, 1.0)}
"""Round trips [s] of the coarse map, over the range of each scheme."""

STROKE = 0.04
"""Motion in free space before the press [m]."""

DEPTH = 0.015
"""Intended depth of the press [m]."""


@dataclass(frozen=True)
class SystemCell:
    """A whole system: an operator's hand, a link and a plane. The defaults are those of the shipped files.

    Args:
        slice: part of the map.
        scheme: of control, as in the configuration.
        predictor: of the force channel.
        position_predictor: of the position channel.
        stiffness_n_m: of the plane.
        mass_kg: of device and hand, as the next two.
        damping_n_s_m: of device and hand.
        hand_stiffness_n_m: of the hand.
        rate_hz: of both sides.
        round_trip_s: constant delay, half of it each way.
        jitter_s: largest additional delay each way, uniform.
        loss: share of datagrams lost.
        weber: Weber factor of both channels.
        floor_n: absolute threshold of the force.
        bound_m: position error at rest that stays unsent.
        seed: of the link.
    """

    slice: str
    scheme: str = "none"
    predictor: str = "hybrid"
    position_predictor: str = "linear"
    stiffness_n_m: float = 500.0
    mass_kg: float = 0.3
    damping_n_s_m: float = 8.0
    hand_stiffness_n_m: float = 300.0
    rate_hz: float = 1000.0
    round_trip_s: float = 0.0
    jitter_s: float = 0.0
    loss: float = 0.0
    weber: float = 0.1
    floor_n: float = 0.02
    bound_m: float = 0.0002
    seed: int = 0

    @property
    def wall(self) -> SampledWall:
        """The sampled wall that corresponds to this cell without coding and loss."""
        one_way = ceil(0.5 * self.round_trip_s * self.rate_hz - 1e-9)
        return SampledWall(
            self.mass_kg,
            self.damping_n_s_m,
            self.hand_stiffness_n_m,
            1.0 / self.rate_hz,
            one_way + max(1, one_way),  # a force received within a tick is applied in the next one
        )

    def limits(self) -> dict[str, float]:
        """Without coding: stiffness [N/m] up to which the loop is stable with this hand, and passive with any."""
        return {"stable_to_n_m": gain_limit(self.wall), "passive_to_n_m": passivity_limit(self.wall)}

    def least_damping(self) -> float:
        """Without coding: damping of device and hand [N s/m] from which the loop is stable."""

        def is_stable(damping: float) -> bool:
            return gain_limit(replace(self.wall, damping_n_s_m=damping)) > self.stiffness_n_m

        return bisect(is_stable, *bracket(is_stable, self.damping_n_s_m), 1e-3)

    def as_json(self) -> dict[str, Any]:
        return asdict(self)


@dataclass(frozen=True)
class CellTiming:
    """Times of the script [s]: the motion is the same for all cells, pauses grow with delay and inertia."""

    press: float
    """The hand begins to go down."""
    hold: float
    """Its intended position is `DEPTH` from here on."""
    release: float
    """It begins to come up."""
    end: float
    steps: tuple[dict[str, Any], ...]
    """The motion as a script of the `operator` device."""


def timing(cell: SystemCell) -> CellTiming:
    """The script of a cell: wait for the session, move, press, hold, release, tap, wait for the link.

    The hold lasts a second, five round trips and three periods of the hand, so that two windows of it show whether an
    oscillation dies out.
    """
    trip = cell.round_trip_s + 2.0 * cell.jitter_s
    period = 2.0 * pi * sqrt(cell.mass_kg / cell.hand_stiffness_n_m)
    lead = 0.3 + 2.5 * trip + (1.5 if cell.loss else 0.0)
    hold = 1.0 + 5.0 * trip + 3.0 * period
    down = 0.4
    steps = (
        {"motion": "rest", "duration_s": lead},
        {"motion": "reach", "to_m": [STROKE, 0.0, HEIGHT], "duration_s": 0.6},
        {"motion": "reach", "to_m": [0.0, 0.0, HEIGHT], "duration_s": 0.6},
        {
            "motion": "press", "at_m": [0.0, 0.0, 0.0], "depth_m": DEPTH, "height_m": HEIGHT,
            "duration_s": down, "hold_s": hold, "approach_s": 0.01,
        },
        {
            "motion": "tap", "at_m": [0.0, 0.0, 0.0], "depth_m": DEPTH, "height_m": HEIGHT,
            "frequency_hz": 2.0, "count": 1, "approach_s": 0.01,
        },
        {"motion": "rest", "duration_s": 0.2 + trip},
    )  # fmt: skip
    press = lead + 1.2 + 0.01
    end = press + down + hold + down + 0.01 + 0.5 + 0.2 + trip
    return CellTiming(press, press + down, press + down + hold, end, steps)


def cells(arrangements: Sequence[tuple[str, str]], seed: int, *, full: bool) -> list[SystemCell]:
    """All cells of the map.

    Args:
        arrangements: pairs of a control scheme and a predictor of the force.
        seed: of every link.
        full: a fine map instead of a coarse one.
    """
    return [replace(cell, seed=seed) for cell in _all(arrangements, full=full)]


def _all(arrangements: Sequence[tuple[str, str]], *, full: bool) -> Iterator[SystemCell]:
    for scheme, predictor in arrangements:
        yield from _stiffness_and_delay(scheme, predictor, full=full)
    yield from _hand(full=full)
    yield from _rate(full=full)
    for scheme, predictor in arrangements:
        if scheme != "none" and (full or scheme != "auto"):  # auto is one of the others
            yield from _bad_link(scheme, predictor, full=full)
            yield from _other_hands(scheme, predictor, full=full)
    yield from _weber(*arrangements[-1], full=full)


def _stiffness_and_delay(scheme: str, predictor: str, *, full: bool) -> Iterator[SystemCell]:
    stiffnesses = _decades(10.0, 1e7, 2) if full else [10.0, 500.0, 1e4, 1e7]
    trips = (0.0, 0.002, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 0.7, 1.0) if full else COARSE_TRIPS.get(scheme, LONG_TRIPS)
    for stiffness, trip in product(stiffnesses, trips):
        yield SystemCell("stiffness x delay", scheme, predictor, stiffness_n_m=stiffness, round_trip_s=trip)


def _uncoded(name: str) -> SystemCell:
    """A cell without coding, where the limits of the sampled wall hold."""
    return SystemCell(name, "none", "zoh", "zoh", weber=0.0, floor_n=0.0, bound_m=0.0)


def _hand(*, full: bool) -> Iterator[SystemCell]:
    masses = _decades(0.001, 10.0, 2 if full else 1)
    dampings = _decades(0.05, 50.0, 2 if full else 1)
    for mass, damping in product(masses, dampings):
        yield replace(_uncoded("mass x damping"), mass_kg=mass, damping_n_s_m=damping)


def _rate(*, full: bool) -> Iterator[SystemCell]:
    rates = (100.0, 250.0, 500.0, 1000.0, 2000.0, 4000.0) if full else (100.0, 1000.0, 4000.0)
    for rate, stiffness in product(rates, _decades(100.0, 1e5, 2) if full else (1e3, 1e4, 1e5)):
        yield replace(_uncoded("rate x stiffness"), rate_hz=rate, stiffness_n_m=stiffness)


def _bad_link(scheme: str, predictor: str, *, full: bool) -> Iterator[SystemCell]:
    jitters = (0.0, 0.002, 0.01, 0.05) if full else (0.01,)
    losses = (0.0, 0.02, 0.1, 0.3) if full else (0.1, 0.3)
    trips = (0.0, 0.02, 0.1, 0.3, 0.7, 1.0) if full else (0.0, 0.1, 0.7)
    for jitter, trip, loss in product(jitters, trips, losses):
        yield SystemCell("loss x delay", scheme, predictor, round_trip_s=trip, jitter_s=jitter, loss=loss)


def _other_hands(scheme: str, predictor: str, *, full: bool) -> Iterator[SystemCell]:
    """Other hands and rates with a delayed, lossy link under control."""
    hands = tuple(product((0.001, 0.03, 1.0, 10.0), (0.5, 8.0, 50.0))) if full else ((0.01, 20.0), (10.0, 20.0))
    rates = (100.0, 1000.0, 4000.0) if full else (1000.0,)
    for (mass, damping), rate, stiffness in product(hands, rates, (500.0, 1e7)):
        cell = SystemCell("hand, delayed", scheme, predictor, round_trip_s=0.1, jitter_s=0.01, loss=0.1)
        yield replace(cell, mass_kg=mass, damping_n_s_m=damping, rate_hz=rate, stiffness_n_m=stiffness)


def _weber(scheme: str, predictor: str, *, full: bool) -> Iterator[SystemCell]:
    webers = (0.0, 0.025, 0.05, 0.1, 0.2, 0.3, 0.5) if full else (0.0, 0.1, 0.5)
    trips = (0.0, 0.02, 0.1, 0.3, 1.0) if full else (0.0, 0.1, 0.7)
    for weber, trip in product(webers, trips):
        yield SystemCell("k x delay", scheme, predictor, weber=weber, round_trip_s=trip)


def _decades(first: float, last: float, each: int) -> list[float]:
    """Values from first to last, `each` per decade, rounded to two digits."""
    values, value = [], first
    while value < last * 1.001:
        values.append(float(f"{value:.2g}"))
        value *= 10.0 ** (1.0 / each)
    return values
