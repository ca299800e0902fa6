"""Run a case, measure from outside what robot and hand did, and check the laws."""

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tests.safety.cases import AFTER, BOTH, CUT, ROBOT_N_M, TO_MASTER, TO_SLAVE, Case
from tests.safety.observed_link import ObservedLink, loop_ages
from tests.system.systems import configuration
from weberlink.protocol.emulation import Emulation
from weberlink.protocol.states import State
from weberlink.system.configuration import Configuration
from weberlink.system.simulate import build_simulation
from weberlink.system.simulation import Simulation, as_array
from weberlink.telemetry.fault import Fault

STILL = 1e-9
"""Smaller steps [m] and forces [N] count as none."""
WALL_M_S = 1.0
"""The force may change as fast as on the device's stiffest wall, touched at this speed [m/s]."""
BACK_S = 0.5
"""In this time after the link is good again, and two round trips, both ends engage, the robot approaches and the force
fades in [s]."""
CODING_M = 0.5e-3
"""What the coding of a position may be off, twice: its deadband at rest and a step of the wire [m]."""


@dataclass(frozen=True)
class Figures:
    """Of one run.

    Attributes:
        robot_ms: from the cut to the last tick in which the robot was still commanded to move; None where it flaps.
        force_ms: from the cut to the last tick with a force on the hand; None where it flaps.
        robot_age_ms: largest true age of the loop in a tick in which the robot was commanded to move.
        force_age_ms: largest true age of the loop in a tick with a force on the hand.
        beyond_mm: how far the robot was from the nearest place where the hand had been by then.
        allowed_mm: how far the hand moves within the limit at its largest speed before the cut.
        retreat_mm: how far the robot was sent back from where it was without a session, and how far otherwise.
        hand_n, robot_n: largest force on the hand, and of the robot on what it touches.
        step_n: largest change of the force on the hand in a tick, from the cut on.
        early_n: how far the force was above an even rise to its limit, in the ramp after the link is good again.
        step_mm: largest change of the robot in a tick as it comes back once the link is good, less that of the hand.
        fault_ms: from the cut to the first named fault of each end; None for none.
        faults: their names.
        returned: whether both ends are in a session at the end.
        round_trip_ms: largest round trip that the ends agreed on until the link was good again; the age and the time
            after a cut may exceed the silence limit by this.
    """

    robot_ms: float | None
    force_ms: float | None
    robot_age_ms: float
    force_age_ms: float
    beyond_mm: float
    allowed_mm: float
    retreat_mm: tuple[float, float]
    hand_n: float
    robot_n: float
    step_n: float
    early_n: float
    step_mm: float
    fault_ms: tuple[float | None, float | None]
    faults: tuple[tuple[str, ...], tuple[str, ...]]
    returned: bool
    round_trip_ms: float


@dataclass(frozen=True)
class Run:
    """A case, its figures (None if a side raised an error), and the laws that it broke."""

    case: Case
    figures: Figures | None
    violations: tuple[str, ...]

    def to_dict(self) -> dict[str, Any]:
        figures = {} if self.figures is None else asdict(self.figures)
        return {"fault": self.case.fault, **asdict(self.case), **figures, "violations": self.violations}


def simulation(loaded: Configuration, forward: ObservedLink, backward: ObservedLink) -> Simulation:
    """Both sides of a configuration with these links between them."""
    built = build_simulation(loaded)
    forward.executed = lambda: sum(built.slave.endpoint.statistics.updates_received)
    backward.executed = lambda: sum(built.master.endpoint.statistics.updates_received)
    links: Any = (forward, backward)
    return Simulation(master=built.master, slave=built.slave, links=links, tick_period=loaded.system.tick_period)


def run(case: Case) -> Run:
    """Run a case and judge it."""
    loaded = configuration(*case.overrides)
    ways = [
        ObservedLink(Emulation(delay_s=delay, blackouts=case.blackouts if case.direction in (way, BOTH) else ()))
        for way, delay in zip((TO_SLAVE, TO_MASTER), case.delay_s, strict=True)
    ]
    simulated = simulation(loaded, *ways)
    ticks = round((case.restored + AFTER + 4.0 * sum(case.delay_s)) / loaded.system.tick_period)
    records, agreed = [], 0.0
    try:
        for number in range(ticks):
            records.append(simulated.step())
            if number * loaded.system.tick_period < case.restored:
                agreed = max(agreed, *(side.endpoint.round_trip_limit for side in (simulated.master, simulated.slave)))
    except Exception as error:
        return Run(case, None, (f"a loop ended with {type(error).__name__}: {error}",))
    masters, slaves = zip(*records, strict=True)
    figures = measure(case, as_array(masters), as_array(slaves), *ways, agreed=agreed, loaded=loaded)
    return Run(case, figures, tuple(violated(case, figures, loaded)))


def measure(
    case: Case,
    master: Any,
    slave: Any,
    forward: ObservedLink,
    backward: ObservedLink,
    *,
    agreed: float,
    loaded: Configuration,
) -> Figures:
    """The figures of a run, from the records of both sides and of the two links, and the agreed round trip [s]."""
    at, limit = master["at"], loaded.system.link.silence_ms * 1e-3 + agreed
    failing = (at >= CUT) & (at < case.restored)
    force = np.linalg.norm(master["output"], axis=1)
    moved = np.concatenate([[0.0], np.linalg.norm(np.diff(slave["output"], axis=0), axis=1)])
    moving = moved > STILL
    alone = failing & (slave["state"] != State.ENGAGED.value)
    if case.retract:  # how it backs off is measured apart
        moving &= ~alone
    felt = force > STILL
    after = (at >= case.restored - (at[1] - at[0])) & (at < case.restored + BACK_S + 2.0 * sum(case.delay_s))
    went = np.concatenate([[0.0], np.linalg.norm(np.diff(master["position"], axis=0), axis=1)])
    before = (at > CUT - limit) & (at < CUT + limit)
    retreat = slave["output"][alone]
    backed, otherwise = (0.0, 0.0)
    if len(retreat) and not case.flap_hz:
        steps = np.diff(retreat, axis=0)
        pressed = float(slave["raw"][alone][0, 2]) / ROBOT_N_M
        backed = float(retreat[-1, 2] - retreat[0, 2] - pressed)  # it counts from the tip, not from the command
        otherwise = float(np.abs(steps[:, :2]).sum() - np.minimum(steps[:, 2], 0.0).sum())
    return Figures(
        robot_ms=None if case.flap_hz else _last(at, failing & moving),
        force_ms=None if case.flap_hz else _last(at, failing & felt),
        robot_age_ms=_oldest(loop_ages(backward, forward, at), failing & moving),
        force_age_ms=_oldest(loop_ages(forward, backward, at), failing & felt),
        beyond_mm=1e3 * _beyond(master["position"], slave["output"], np.flatnonzero(failing)),
        allowed_mm=1e3 * float(went[before].max()) / (at[1] - at[0]) * limit,
        retreat_mm=(1e3 * backed, 1e3 * otherwise),
        hand_n=float(force[at >= CUT].max()),
        robot_n=float(np.linalg.norm(slave["raw"][failing], axis=1).max()),
        step_n=float(np.linalg.norm(np.diff(master["output"][at >= CUT], axis=0), axis=1).max()),
        early_n=_early(at, force, after & (master["state"] == State.ENGAGED.value), loaded),
        step_mm=1e3 * max(0.0, float(moved[after][1:].max() - went[after].max())),
        fault_ms=(_first_fault(at, master, failing), _first_fault(at, slave, failing)),
        faults=(_faults(master[failing]), _faults(slave[failing])),
        returned=bool(master["state"][-1] == slave["state"][-1] == State.ENGAGED.value),
        round_trip_ms=1e3 * agreed,
    )


def violated(case: Case, figures: Figures, loaded: Configuration) -> list[str]:
    """The laws that a run has broken."""
    system = loaded.system
    limit_ms, tick_ms = system.link.silence_ms + figures.round_trip_ms, 1e3 * system.tick_period
    within = limit_ms + tick_ms + 0.01
    limits = system.master.limits
    found = [
        f"{name} {value:.0f} ms > {most:.0f} ms"
        for name, value, most in (
            ("the robot moved at a loop age of", figures.robot_age_ms, within),
            ("force was on the hand at a loop age of", figures.force_age_ms, within),
            ("the robot moved after the cut for", figures.robot_ms or 0.0, within),
            ("force was on the hand after the cut for", figures.force_ms or 0.0, within),
        )
        if value > most
    ]
    if figures.beyond_mm > figures.allowed_mm + 1e3 * CODING_M:
        found.append(f"the robot went {figures.beyond_mm:.1f} mm beyond the hand, {figures.allowed_mm:.1f} mm allowed")
    if figures.hand_n > limits.force_n * (1.0 + 1e-9):
        found.append(f"{figures.hand_n:.2f} N on the hand, {limits.force_n:g} N allowed")
    assert loaded.device is not None
    most_step = loaded.device.options.stiffness_n_m * WALL_M_S * system.tick_period  # type: ignore[attr-defined]
    if figures.step_n > most_step * (1.0 + 1e-9):
        found.append(f"the force changed by {figures.step_n:.2f} N in a tick, {most_step:.2f} N allowed")
    if not figures.returned:
        found.append("no session once the link was good again")
    if case.longest_dark > 1e-3 * limit_ms + sum(case.delay_s):
        found += _after_silence(case, figures, loaded, within)
    return found


def _after_silence(case: Case, figures: Figures, loaded: Configuration, within: float) -> list[str]:
    """What holds where the link was cut for longer than the limits."""
    system, found = loaded.system, []
    for side, first in zip(("master", "slave"), figures.fault_ms, strict=True):
        if first is None:
            found.append(f"the {side} names no fault")
        elif not case.flap_hz and first > within:
            found.append(f"the {side} names a fault after {first:.0f} ms only")
    tick = system.tick_period
    if not case.flap_hz and figures.early_n > STILL:
        found.append(f"the force came back {figures.early_n:.2f} N above its ramp")
    approach = 1e3 * system.slave.limits.approach_speed_m_s * tick + 1e3 * CODING_M
    if not case.flap_hz and figures.step_mm > approach:
        found.append(f"the robot came back by {figures.step_mm:.2f} mm in a tick, {approach:.2f} mm allowed")
    backed, otherwise = figures.retreat_mm
    if case.retract and (otherwise > 1e3 * CODING_M or backed > 1e3 * system.slave.limits.retract_m + 0.1):
        found.append(f"the robot backed off {backed:.1f} mm, and moved {otherwise:.1f} mm otherwise")
    return found


def _early(
    at: NDArray[np.float64], force: NDArray[np.float64], back: NDArray[np.bool_], loaded: Configuration
) -> float:
    """By how much the force is above an even rise to its limit, from the first of these ticks on [N]."""
    limits = loaded.system.master.limits
    since = at[back] - at[back][0] + loaded.system.tick_period if back.any() else np.zeros(1)
    envelope = limits.force_n * since / (limits.ramp_ms * 1e-3)
    return max(0.0, float((force[back] - envelope).max())) if back.any() else 0.0


def _last(at: NDArray[np.float64], which: NDArray[np.bool_]) -> float:
    """From the cut to the end of the last tick chosen [ms]; 0 for none."""
    return 1e3 * float(at[which][-1] - CUT) if which.any() else 0.0


def _oldest(ages: NDArray[np.float64], which: NDArray[np.bool_]) -> float:
    """[ms]; 0 where no tick is chosen."""
    return 1e3 * float(ages[which].max()) if which.any() else 0.0


def _beyond(hand: NDArray[np.float64], robot: NDArray[np.float64], ticks: NDArray[np.int64]) -> float:
    """Largest distance of the robot, at these ticks, from the nearest place where the hand had been by then [m]."""
    farthest = 0.0
    where: NDArray[np.float64] | None = None
    for tick in ticks[::5]:
        if where is None or np.any(robot[tick] != where):
            where = robot[tick]
            farthest = max(farthest, float(np.min(np.linalg.norm(hand[: tick + 1] - where, axis=1))))
    return farthest


def _first_fault(at: NDArray[np.float64], records: Any, failing: NDArray[np.bool_]) -> float | None:
    named = failing & (records["fault"] != Fault.NONE)
    return 1e3 * float(at[named][0] - CUT) if named.any() else None


def _faults(records: Any) -> tuple[str, ...]:
    return tuple(sorted(Fault(int(value)).name for value in set(records["fault"]) - {Fault.NONE}))
