"""The walls of the map, each with its limits by theory and by measurement."""

from collections.abc import Iterator
from dataclasses import asdict
from itertools import product
from typing import get_args

from weberlink_studies.frame import Row
from weberlink_studies.stability.measured_wall import activity, measured_limit
from weberlink_studies.stability.wall import Grip, SampledWall, passivity_limit, stability_limit

FREE_HAND = 0.01  # stiffness of a hand that hardly holds the device [N/m], a hard case for Colgate's bound

RATIOS = (0.2, 0.5, 0.9, 0.99, 1.01, 2.0)
"""Stiffnesses, in units of the passive limit, at which the activity is measured."""


GRIPS: tuple[Grip, ...] = get_args(Grip)


def survey(wall: SampledWall) -> Row:
    """Compute and measure one wall; stiffnesses in N/m.

    `stable_to_n_m` is by the eigenvalues, `passive_to_n_m` by the bound of Colgate and Schenkel (0 if it is never
    passive), `measured_n_m` with the real hand and plane. In `cells`, a wall is active where its `activity` is above 0;
    `passive_but_active` counts those on the passive side of the bound, and should be 0.
    """
    passive, stable, measured = passivity_limit(wall), stability_limit(wall), measured_limit(wall)
    stiffnesses = [ratio * passive for ratio in RATIOS] if passive else []
    found = [(stiffness, activity(wall, stiffness)) for stiffness in stiffnesses]
    return asdict(wall) | {
        "stable_to_n_m": stable,
        "passive_to_n_m": passive,
        "measured_n_m": measured,
        "deviation": measured / stable - 1.0,
        "passive_but_active": sum(energy > 0.0 and stiffness <= passive for stiffness, energy in found),
        "cells": [{"stiffness_n_m": stiffness, "activity": energy} for stiffness, energy in found],
    }


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
