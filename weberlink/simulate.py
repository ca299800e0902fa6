"""A configuration in virtual time: composed as the daemons are, driven by a simulation instead of a clock."""

from random import Random
from time import perf_counter
from typing import Any

from evaluation.recording import TraceRecorder
from evaluation.session import SessionScore
from evaluation.simulation import SLAVE_ADDRESS, Simulation
from weberlink.composition.emulation import build_link
from weberlink.composition.link import build_security, channels
from weberlink.composition.master import build_master
from weberlink.composition.slave import build_slave
from weberlink.configuration import Configuration
from weberlink.configuration.model import EmulationSettings

DEFAULT_DURATION = 60.0
"""Of a device that never ends by itself [s]."""


def build_simulation(configuration: Configuration) -> Simulation:
    """Both sides and their link, not yet begun. Chance comes from the seed of `link.emulate` alone.

    Raises:
        ConfigurationError: if a part cannot be made as the file asks.
    """
    system = configuration.system
    emulation = system.link.emulate or EmulationSettings()
    chance = {name: Random(f"{emulation.seed}/{name}") for name in ("master", "slave", "forward", "backward")}  # noqa: S311
    return Simulation(
        master=build_master(
            configuration,
            security=build_security(configuration),
            entropy=chance["master"].randbytes,
            epoch=0.0,
            stopwatch=_no_time,
            peer=SLAVE_ADDRESS,
        ),
        slave=build_slave(
            configuration,
            security=build_security(configuration),
            entropy=chance["slave"].randbytes,
            epoch=0.0,
            stopwatch=_no_time,
        ),
        links=(
            build_link(emulation, chance["forward"].random, 0.0),
            build_link(emulation, chance["backward"].random, 0.0),
        ),
        tick_period=system.tick_period,
    )


def simulate(configuration: Configuration, duration: float | None) -> tuple[dict[str, Any], TraceRecorder]:
    """Run to the end of the duration [s] or of the device's motion.

    Args:
        configuration: both sides.
        duration: [s]; None for `DEFAULT_DURATION`.

    Returns:
        The figures of the session, and what the robot was commanded and felt.

    Raises:
        ConfigurationError: if a part cannot be made as the file asks.
    """
    system = configuration.system
    simulation = build_simulation(configuration)
    score = SessionScore(system.rate_hz, channels(system)[1].bank)
    began = perf_counter()
    recorder = TraceRecorder()
    simulation.run(DEFAULT_DURATION if duration is None else duration, [score, recorder])
    run_time = perf_counter() - began
    master, slave = simulation.master, simulation.slave
    failures = [side.failure for side in (master, slave) if side.failure is not None]
    summary = score.summary() | {
        "faults": {"master": master.faults, "slave": slave.faults},
        "drops": {
            name: {str(reason): count for reason, count in side.endpoint.statistics.dropped.items()}
            for name, side in (("master", master), ("slave", slave))
        },
        "outcome": f"failed: {'; '.join(failures)}" if failures else "completed",
        "status": 1 if failures else 0,
        "run_time_s": run_time,
        "seed": (system.link.emulate or EmulationSettings()).seed,
    }
    return summary, recorder


def _no_time() -> float:
    """The stopwatch of virtual time: equal runs must be equal bit for bit."""
    return 0.0
