"""A system of a configuration in virtual time, and the records of both sides."""

import numpy as np

from weberlink.config import Configuration
from weberlink.figures.session import Records
from weberlink_studies.baselines import build_with


def recorded(configuration: Configuration, scheme: str, duration_s: float) -> tuple[tuple[Records, Records], str]:
    """Records of master and slave under a control scheme, and why a side ended early; empty if neither did."""
    simulation = build_with(configuration, scheme)
    kept: list[tuple[Records, Records]] = []

    try:
        simulation.run(duration_s, [lambda master, slave: kept.append((master.copy(), slave.copy()))])
    finally:
        simulation.close()
    failures = [side.failure for side in (simulation.master, simulation.slave) if side.failure is not None]
    master, slave = zip(*kept, strict=True)
    return (np.concatenate(master), np.concatenate(slave)), "; ".join(failures)
