"""Control schemes from the literature, to compare with. The studies run them by name; a configuration cannot.

Wave variables (Niemeyer, Slotine, "Stable adaptive teleoperation", IEEE J. Oceanic Eng. 16(1), 1991) are not among
them: their position form sends the integral of the force, which grows without bound in a held contact, while the
forward channel carries a position within a workspace; and what comes back is the measured force, evaluated by its
predictor at the present position of the hand, instead of a wave as it left.
"""

from dataclasses import replace

import numpy as np

from weberlink.config import Configuration
from weberlink.control.table import BUILT_IN, Scheme
from weberlink.session.simulation import build_simulation
from weberlink.telemetry.reader import Records

BASELINES = {
    "baseline-tdpa": Scheme(
        "weberlink_studies.baselines.tdpa:TdpaMaster",
        "weberlink_studies.baselines.tdpa:TdpaSlave",
        carries_credit=True,
        does="time-domain passivity: an observer and a controller at each port",
        reads_position=False,
    )
}
"""By name."""


def recorded(configuration: Configuration, scheme: str, duration_s: float) -> tuple[tuple[Records, Records], str]:
    """Records of master and slave in virtual time, and why a side ended early; empty if neither did.

    `scheme` is one of `BASELINES` or of the registry, which is left as it was.
    """
    system = configuration.system
    control = system.control.model_copy(update={"scheme": scheme})
    chosen = replace(configuration, system=system.model_copy(update={"control": control}))
    added = BASELINES.keys() - BUILT_IN.keys()
    BUILT_IN.update(BASELINES)
    try:
        simulation = build_simulation(chosen)
    finally:
        for name in added:
            del BUILT_IN[name]
    kept: list[tuple[Records, Records]] = []
    try:
        simulation.run(duration_s, [lambda master, slave: kept.append((master.copy(), slave.copy()))])
    finally:
        simulation.close()
    failures = [side.failure for side in (simulation.master, simulation.slave) if side.failure is not None]
    master, slave = zip(*kept, strict=True)
    return (np.concatenate(master), np.concatenate(slave)), "; ".join(failures)
