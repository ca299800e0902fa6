"""Control schemes from the literature, to compare with. The studies run them by name; a configuration cannot.

Wave variables (Niemeyer, Slotine, "Stable adaptive teleoperation", IEEE J. Oceanic Eng. 16(1), 1991) are not among
them: their position form sends the integral of the force, which grows without bound in a held contact, while the
forward channel carries a position within a workspace; and what comes back is the measured force, evaluated by its
predictor at the present position of the hand, instead of a wave as it left.
"""

from dataclasses import replace

from weberlink.config import Configuration
from weberlink.control.table import BUILT_IN, Scheme
from weberlink.session.simulation import Simulation, build_simulation

BASELINES = {
    "baseline-tdpa": Scheme(
        "weberlink_studies.baselines.tdpa:TdpaMaster",
        "weberlink_studies.baselines.tdpa:TdpaSlave",
        carries_credit=True,
        does="time-domain passivity: an observer and a controller at each port",
        reads_position=False,
    ),
}
"""By name."""


def build_with(configuration: Configuration, scheme: str) -> Simulation:
    """Both sides of a file with another control scheme, of `BASELINES` or of the registry, which is left as it was."""
    system = configuration.system
    control = system.control.model_copy(update={"scheme": scheme})
    chosen = replace(configuration, system=system.model_copy(update={"control": control}))
    added = BASELINES.keys() - BUILT_IN.keys()
    BUILT_IN.update(BASELINES)
    try:
        return build_simulation(chosen)
    finally:
        for name in added:
            del BUILT_IN[name]
