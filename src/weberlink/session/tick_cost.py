"""Measure how long a tick takes on this machine, before a run."""

from dataclasses import replace
from statistics import median
from time import perf_counter

from weberlink.config import Configuration, ConfigurationError
from weberlink.config.loading import Part
from weberlink.config.model import MasterSettings, SlaveSettings
from weberlink.master.devices import DEVICES
from weberlink.session.simulation import build_simulation
from weberlink.slave.robots import ROBOTS

TICKS = 600
"""Measured in 0.1 s or less."""


def measured_tick_s(configuration: Configuration) -> float | None:
    """Median run time of a tick of both sides in virtual time [s], which is about that of one side in real time.

    A simulated hand and a point stand in for what cannot run in virtual time; None where they do not fit the file.
    """
    system = configuration.system
    link = system.link.model_copy(update={"emulate": None})  # a session begins at once
    here = replace(configuration, system=system.model_copy(update={"link": link}))
    for candidate in (here, _computed(here)):
        try:
            simulation = build_simulation(candidate)
        except ConfigurationError:
            continue
        times = []
        try:
            for _ in range(TICKS):
                began = perf_counter()
                simulation.step()
                times.append(perf_counter() - began)
        finally:
            simulation.close()
        return median(times)
    return None


def _computed(configuration: Configuration) -> Configuration:
    """The same coding of position and force between a simulated hand and a point."""
    system = configuration.system
    codec = system.codec.model_copy(update={"rotation": None, "joints": None, "gripper": None})
    parts = {"codec": codec, "master": MasterSettings(), "slave": SlaveSettings()}
    hand, point = DEVICES["operator"], ROBOTS["point"]
    return replace(
        configuration,
        system=system.model_copy(update=parts),
        device=Part(hand, hand.Options()),
        robot=Part(point, point.Options()),
    )
