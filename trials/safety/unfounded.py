"""No force without a contact: random sessions, and a judge that knows what the robot really touched.

python -m trials.safety.unfounded --cells 2000
"""

import argparse
import json
import sys
from collections import Counter
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from math import exp, log
from os import cpu_count
from random import Random
from time import monotonic
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tests.session.systems import configuration
from weberlink.control.contract import FREE_FORCE, LEAST_CONTACT
from weberlink.session.simulation import build_simulation
from weberlink.telemetry.fault import Fault
from weberlink.telemetry.reader import Records

SECONDS = 4.0  # length of a session [s]
# What each session draws from, also of the guest `predictors`: models of a surface have the most to go wrong.
SCHEMES = ("none", *("bounded",) * 3)
PREDICTION = (
    *("zoh", "linear", "plane", "sphere", "affine", "surface", "path", "elastic", "hybrid"),
    *("surface", "adaptive") * 3,
)
PATIENCE = 0.05  # what the law allows beyond the round trip [s]
REPAIR_S = 0.06  # a lost update is repeated a round trip and so much later, on a link that loses one in fifty [s]


@dataclass(frozen=True)
class Cell:
    seed: int
    overrides: tuple[str, ...]  # of configs/loopback.yaml, as of `--set`
    delay_s: tuple[float, float]  # one-way delay to the slave and to the master [s]
    jitter_s: float = 0.0  # largest additional delay [s]
    loss: float = 0.0  # share of datagrams
    ahead_s: float = 0.0  # how much later than it could the force is displayed, for look-ahead [s]

    @property
    def round_trip(self) -> float:
        """The longest one of the signals, without loss [s]."""
        return sum(self.delay_s) + 2.0 * self.jitter_s + self.ahead_s


def cell(seed: int) -> Cell:
    chance = Random(seed)
    one = chance.uniform(0.0, 0.25)
    other = chance.choice([one, one, chance.uniform(0.0, 0.25), 0.0])  # alike, or one of them short
    delay = chance.choice([(one, other), (other, one)])
    jitter, loss = chance.choice([0.0, 0.0, chance.uniform(0.0, 0.005)]), chance.choice([0.0, 0.0, 0.0, 0.02])
    thing = _thing(chance)
    ways = {
        way: {"delay_ms": 1e3 * each, "jitter_ms": 1e3 * jitter, "loss": loss}
        for way, each in zip(("to_slave", "to_master"), delay, strict=True)
    }
    round_trip_ms = 1e3 * (sum(delay) + 2.0 * jitter)
    overrides = [
        f"rate_hz={chance.choice([500, 1000])}",
        f"slave.scene={json.dumps([thing])}",
        f"slave.robot.driver={'point' if 'motion' in thing else chance.choice(['point', 'simulated'])}",
        f"master.device.hand={json.dumps(_hand(chance))}",
        f"master.device.script={json.dumps(_script(chance))}",
        f"control.scheme={chance.choice(SCHEMES)}",
        f"codec.force.predictor={chance.choice(PREDICTION)}",
        f"codec.position.bound_m={_between(chance, 5e-5, 5e-4):.2g}",
        "codec.position.step_m=0.000002",
        f"link.longest_round_trip_ms={round(2.0 * round_trip_ms + 400.0)}",
        f"link.emulate={json.dumps(ways | {'seed': seed})}",
    ]
    if chance.random() < 0.15:
        overrides.append(f"codec.force.smooth_ms={chance.choice([10, 20])}")
    if chance.random() < 0.15:
        overrides.append(f"slave.limits.trip_n={chance.uniform(2.0, 8.0):.2g}")
    ahead_ms = chance.choice([5, 10]) if chance.random() < 0.1 else 0
    overrides.append(f"codec.force.lookahead_ms={ahead_ms}")
    return Cell(seed, tuple(overrides), delay, jitter, loss, 1e-3 * ahead_ms)


def _between(chance: Random, low: float, high: float) -> float:
    return exp(chance.uniform(log(low), log(high)))


def _thing(chance: Random) -> dict[str, Any]:
    """Something to touch at z = 0: elastic, half of it damped, rubbing or moving too."""
    bumps = {"amplitude_m": _between(chance, 5e-4, 3e-3), "wavelength_m": _between(chance, 0.01, 0.05)}
    shapes: list[dict[str, Any]] = [
        {"shape": "plane"},
        {"shape": "sphere", "center_m": [0.0, 0.0, -0.06], "radius_m": 0.06},
        {"shape": "box", "center_m": [0.0, 0.0, -0.05], "size_m": [0.08, 0.08, 0.1]},
        {"shape": "height_field", "bumps": bumps},
    ]
    thing = {**chance.choice(shapes), "stiffness_n_m": _between(chance, 150.0, 2500.0)}
    if chance.random() < 0.5:
        thing["damping_n_s_m"] = _between(chance, 0.2, 5.0)
    if chance.random() < 0.4:
        dynamic = chance.uniform(0.0, 0.5)
        thing["friction"] = {"static": dynamic + chance.uniform(0.0, 0.2), "dynamic": dynamic}
    if chance.random() < 0.3:
        thing["motion"] = {"amplitude_m": _between(chance, 1e-3, 0.01), "frequency_hz": _between(chance, 0.2, 2.0)}
    return thing


def _hand(chance: Random) -> dict[str, float]:
    ranges = {"mass_kg": (0.1, 1.0), "damping_n_s_m": (2.0, 20.0), "stiffness_n_m": (80.0, 800.0)}
    return {name: _between(chance, low, high) for name, (low, high) in ranges.items()}


def _script(chance: Random) -> list[dict[str, Any]]:
    """What the hand does, for about the length of a session."""

    def place(across: float = 0.03, height: float = 0.0) -> list[float]:
        return [chance.uniform(-across, across), chance.uniform(-across, across), height]

    def step() -> dict[str, Any]:
        pressed = {"depth_m": chance.uniform(0.004, 0.025), "approach_s": chance.uniform(0.2, 0.6)}
        uniform = chance.uniform
        steps: list[dict[str, Any]] = [  # a seed means a session, so the order of the draws stays
            {"motion": "slide", "points_m": [place(), place()], "duration_s": uniform(0.4, 1.2)},
            {"motion": "tap", "at_m": place(), "height_m": _between(chance, 0.002, 0.02)}
            | {"frequency_hz": _between(chance, 1.0, 8.0), "count": chance.randint(2, 8)},
            {"motion": "press", "at_m": place(), "hold_s": uniform(0.1, 1.0), "height_m": uniform(0.0, 0.02)}
            | {"duration_s": uniform(0.1, 0.6)},
            {"motion": "circle", "center_m": place(0.01), "radius_m": uniform(0.005, 0.03)}
            | {"duration_s": uniform(0.8, 2.0)},
            {"motion": "reach", "to_m": place(height=uniform(-0.02, 0.04)), "duration_s": uniform(0.2, 0.8)},
        ]
        chosen = chance.choice(steps)
        return chosen if chosen["motion"] == "reach" else chosen | pressed

    return [step() for _ in range(4)]


@dataclass(frozen=True)
class Finding:
    cell: Cell  # the session
    longest: float  # longest time with more than `FREE_FORCE` on the hand while the robot touched nothing [s]
    allowed: float  # the time that the law allows [s]
    ticks: int  # in which the law was broken
    largest: float  # force in these ticks [N]
    faults: int  # how often the operator's end named the fault
    rash: int  # that of these for which the robot had touched something as late as a round trip and `PATIENCE` before
    contact: float  # share of ticks in which the robot touched something


def found(cell: Cell, master: Records, slave: Records, period: float) -> Finding:
    """What a session showed: the force on the hand beside what the robot touched, by the clock of both."""
    # The robot's end has stated what it feels once it can have arrived: a delay later, and after a loss a round trip
    # later still. A run of force without a contact begins with the force, or with the end of the contact.
    felt = np.linalg.norm(master["output"], axis=1)
    touches = np.linalg.norm(slave["raw"], axis=1) > LEAST_CONTACT
    late = cell.round_trip + REPAIR_S if cell.loss else 0.0
    arrival = round((cell.delay_s[1] + cell.jitter_s + cell.ahead_s) / period) + 2
    lasted = period * _since(touches, arrival, felt <= FREE_FORCE * (1.0 + 1e-9))
    allowed = cell.round_trip + PATIENCE + late
    broken = lasted > allowed + period
    onset = np.flatnonzero((master["fault"][1:] == Fault.UNFOUNDED) & (master["fault"][:-1] != Fault.UNFOUNDED)) + 1
    never = np.zeros(len(felt), dtype=np.bool_)
    told = np.concatenate([never[:arrival], touches])[: len(felt)]  # a contact that began since then is not known yet
    untouched = period * _since(told, 0, never)
    early = sum(cell.delay_s) + PATIENCE - 0.01
    return Finding(
        cell=cell,
        longest=float(lasted.max()),
        allowed=allowed,
        ticks=int(broken.sum()),
        largest=float(felt[broken].max()) if broken.any() else 0.0,
        faults=len(onset),
        rash=int((untouched[onset] < early).sum()),
        contact=float(touches.mean()),
    )


def _since(touches: NDArray[np.bool_], arrival: int, free: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Ticks since the last one without a force, or with a contact that had arrived, whichever is later."""
    tick = np.arange(len(free))
    stated = np.maximum.accumulate(np.where(touches, tick + arrival, 0))
    begun = np.maximum.accumulate(np.where(free, tick, 0))
    return np.where(free, 0, tick - np.maximum(stated, begun)).clip(0)


def run(seed: int) -> Finding:
    made = cell(seed)
    loaded = configuration(*made.overrides)
    period = loaded.system.tick_period
    return found(made, *build_simulation(loaded).advance(round(SECONDS / period)), period)


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--cells", type=int, default=2000)
    parser.add_argument("--first", type=int, default=0, help="seed of the first cell")
    parser.add_argument("--workers", type=int, default=cpu_count() or 1)
    chosen = parser.parse_args(arguments)
    began, count, figures = monotonic(), 0, Counter[str]()
    with ProcessPoolExecutor(chosen.workers) as pool:
        for each in pool.map(run, range(chosen.first, chosen.first + chosen.cells)):
            count += 1
            figures.update(broken=each.ticks > 0, faulted=each.faults > 0, rash=each.rash > 0, touched=each.contact > 0)
            if each.ticks or each.faults:
                sys.stdout.write(f"{monotonic() - began:.0f} s, {_line(each)}\n")
                sys.stdout.flush()
    sys.stdout.write(
        f"{count} cells, {figures['touched']} with a contact: {figures['broken']} broke the law, {figures['faulted']} "
        f"named the fault, {figures['rash']} of them too early; {monotonic() - began:.0f} s\n"
    )
    return 1 if figures["broken"] or figures["rash"] else 0


def _line(finding: Finding) -> str:
    made = finding.cell
    kept = [each for each in made.overrides if each.startswith(("control", "codec.force", "slave", "rate"))]
    delays = " and ".join(f"{1e3 * each:.0f}" for each in made.delay_s)
    return (
        f"seed {made.seed}: {1e3 * finding.longest:.0f} ms, {1e3 * finding.allowed:.0f} allowed; {finding.ticks} ticks "
        f"too long with up to {finding.largest:.1f} N; {finding.faults} faults, {finding.rash} too early; {delays} ms, "
        f"jitter {1e3 * made.jitter_s:.1f} ms, loss {made.loss}; {', '.join(kept)}"
    )


if __name__ == "__main__":
    sys.exit(main())
