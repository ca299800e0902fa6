"""The walls of the map, each with its limits by theory and by measurement."""

from collections.abc import Iterator
from dataclasses import asdict, dataclass
from itertools import product
from typing import Any, get_args

from weberlink.studies.stability.measured_wall import activity, measured_limit
from weberlink.studies.stability.wall import Grip, SampledWall, passivity_limit, stability_limit

FREE_HAND = 0.01
"""Stiffness of a hand that hardly holds the device [N/m], a hard case for Colgate's bound."""

RATIOS = (0.2, 0.5, 0.9, 0.99, 1.01, 2.0)
"""Stiffnesses, in units of the passive limit, at which the activity is measured."""


GRIPS: tuple[Grip, ...] = get_args(Grip)


@dataclass(frozen=True)
class WallRow:
    """Limits of one wall, stiffness in N/m."""

    wall: SampledWall
    stable_to_n_m: float
    """By the eigenvalues."""
    passive_to_n_m: float
    """By the bound of Colgate and Schenkel; 0 if it is never passive."""
    measured_n_m: float
    """With the real hand and plane."""
    activities: tuple[tuple[float, float], ...]
    """Stiffness and activity; above 0 the wall is active."""

    @property
    def deviation(self) -> float:
        """Relative deviation of the measured limit from that of the eigenvalues."""
        return self.measured_n_m / self.stable_to_n_m - 1.0

    @property
    def passive_but_active(self) -> int:
        """Number of stiffnesses on the passive side of the bound that were active; should be 0."""
        return sum(energy > 0.0 and stiffness <= self.passive_to_n_m for stiffness, energy in self.activities)

    def as_json(self) -> dict[str, Any]:
        return asdict(self.wall) | {
            "stable_to_n_m": self.stable_to_n_m,
            "passive_to_n_m": self.passive_to_n_m,
            "measured_n_m": self.measured_n_m,
            "deviation": self.deviation,
            "cells": [{"stiffness_n_m": stiffness, "activity": energy} for stiffness, energy in self.activities],
        }


def survey(wall: SampledWall) -> WallRow:
    """Compute and measure one wall.

    Raises:
        ValueError: if it has no limit.
    """
    passive = passivity_limit(wall)
    stiffnesses = [ratio * passive for ratio in RATIOS] if passive else []
    return WallRow(
        wall,
        stable_to_n_m=stability_limit(wall),
        passive_to_n_m=passive,
        measured_n_m=measured_limit(wall),
        activities=tuple((stiffness, activity(wall, stiffness)) for stiffness in stiffnesses),
    )


def walls(*, full: bool) -> list[SampledWall]:
    """The walls of a survey; `full` has finer steps, more delays and damped walls."""
    return list(_many() if full else _few())


def _few() -> Iterator[SampledWall]:
    for damping, mass, rate in product((0.05, 5.0), (0.001, 0.1, 10.0), (100.0, 4000.0)):
        yield SampledWall(mass, damping, FREE_HAND, 1.0 / rate)
    for grip in GRIPS:
        yield SampledWall(0.3, 8.0, 300.0, 1e-3, delay_ticks=1, grip=grip)


def _many() -> Iterator[SampledWall]:
    dampings, masses = (0.05, 0.15, 0.5, 1.5, 5.0, 15.0, 50.0), (0.001, 0.01, 0.1, 1.0, 10.0)
    for damping, mass, rate in product(dampings, masses, (100.0, 1000.0, 4000.0)):
        for delay in (0, 1, 4):
            yield SampledWall(mass, damping, FREE_HAND, 1.0 / rate, delay)
        yield SampledWall(mass, damping, FREE_HAND, 1.0 / rate, 0, 0.3 * damping)
        for grip in GRIPS:
            yield SampledWall(mass, damping, 300.0, 1.0 / rate, 1, grip=grip)
