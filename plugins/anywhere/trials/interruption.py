"""What hand and robot did while a path failed under a live session, and which promises of docs/safety.md were broken.

Both daemons run on this machine, so their records have one clock. The bounds are those of `trials.safety.run`, which
judges the same promises in virtual time; here a tick may be late, as the host is.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from tests.program import ENGAGED, Records
from trials.safety.run import CODING_M, STILL, WALL_M_S
from weberlink.config import Configuration
from weberlink.telemetry.fault import Fault

SILENCE, NOTHING, EITHER = "silence", "nothing", "either"
LAG_M = 0.002
"""How far the simulated robot (0.2 kg, critically damped, 3000 N/m) may be from its command in contact, because a
retreat counts from where the robot is: 5 N press it 1.7 mm away, and it lags a slide of 0.09 m/s by 16 ms, 1.5 mm."""
STALL_S = 0.03  # by which a busy machine may delay a tick that reads what has arrived [s]


@dataclass(frozen=True)
class Interruption:
    """Of one run."""

    contact_n: float  # force on the hand in the last tick before the fault
    away_ms: float  # how long hand or robot were without a session
    back_ms: float | None  # from the end of the fault until both are in a session again; None if they are not
    # from the last datagram that a side heard to its last tick with force on the hand, or of the session in which the
    # robot moved
    force_ms: float
    robot_ms: float
    backed_mm: float  # how far the robot backed off without a session, and how far it moved otherwise
    astray_mm: float
    step_n: float  # largest change of force on the hand for each tick that passed, from the fault on
    early_n: float  # how far the force was above an even rise to its limit, once the session was back
    step_mm: float  # largest step of the robot in a tick, once the session was back, less that of the hand
    faults: tuple[tuple[str, ...], ...]  # named by master and slave
    sessions: int  # how often the master engaged again


class Course:
    """What one side did, by records with the fault in them; it began in a session at `failed` [s]."""

    def __init__(self, records: Records, failed: float) -> None:
        self.records, at = records, records["at"]
        self.is_engaged = records["state"] == ENGAGED
        self.after = at >= failed
        self.gone = at[self.after & ~self.is_engaged]  # without a session since [s]
        # ticks from the fault until there is a session again, and those in a session after the last ones without
        returns = at[(at > self.gone[0]) & self.is_engaged] if len(self.gone) else at[:0]
        self.first = self.after & (at < (returns[0] if len(returns) else np.inf)) & bool(len(self.gone))
        self.again = self.is_engaged & (at > (self.gone[-1] if len(self.gone) else np.inf))
        self.moved = np.abs(np.diff(records["output"], axis=0, prepend=records["output"][:1])).max(axis=1)

    def back(self, restored: float) -> float | None:
        """From the end of the fault to the session that lasts until the end [s]."""
        if not self.is_engaged[-1]:
            return None
        return max(0.0, float(self.gone[-1]) - restored) if len(self.gone) else 0.0

    def since_heard(self, acts: Any) -> float:
        """From the last datagram before the silence to the last of these ticks before the session is back [s]."""
        at, heard = self.records["at"], np.diff(self.records["datagrams_received"].astype(np.int64), prepend=0) > 0
        if not (self.first & acts).any():
            return 0.0
        return max(0.0, float(at[self.first & acts][-1] - at[heard & (at < self.gone[0])][-1]))

    def faults(self) -> tuple[str, ...]:
        values = set(self.records["fault"][self.after].tolist()) - {0}
        return tuple(sorted(Fault(value).name.lower() for value in values))


def measure(master: Records, slave: Records, failed: float, restored: float, loaded: Configuration) -> Interruption:
    """The figures of a run whose fault began in a session at `failed`, and was over at `restored` [s]."""
    hand, robot = Course(master, failed), Course(slave, failed)
    force = np.linalg.norm(master["output"], axis=1)
    backs = [side.back(restored) for side in (hand, robot)]
    alone = np.diff(slave["output"][robot.first & ~robot.is_engaged], axis=0)
    limits, at = loaded.system.master.limits, master["at"][hand.again]
    envelope = limits.force_n / (1e-3 * limits.ramp_ms) * (at - at[:1] + loaded.system.tick_period)
    went = np.linalg.norm(np.diff(master["position"], axis=0), axis=1).max()
    steps = np.linalg.norm(np.diff(slave["output"][robot.again], axis=0), axis=1)
    return Interruption(
        contact_n=float(force[~hand.after][-1]),
        away_ms=1e3 * max(float(np.ptp(side.gone)) if len(side.gone) else 0.0 for side in (hand, robot)),
        back_ms=None if None in backs else 1e3 * max(each for each in backs if each is not None),
        force_ms=1e3 * hand.since_heard(force > STILL),
        robot_ms=1e3 * robot.since_heard((robot.moved > STILL) & robot.is_engaged),
        backed_mm=1e3 * float(alone[:, 2].sum()),
        astray_mm=1e3 * float(np.abs(alone[:, :2]).sum() - np.minimum(alone[:, 2], 0.0).sum()),
        step_n=float((np.abs(np.diff(force)) / np.diff(master["tick"].astype(np.int64)))[hand.after[1:]].max()),
        early_n=float((force[hand.again] - envelope).max(initial=0.0)),
        step_mm=1e3 * float((steps - went).max(initial=0.0)),
        faults=(hand.faults(), robot.faults()),
        sessions=int((np.diff(hand.is_engaged[hand.after].astype(np.int8)) == 1).sum()),
    )


def violated(found: Interruption, loaded: Configuration, effect: str) -> list[str]:
    """The promises that a run has broken; `effect` is what the fault must lead to: SILENCE, NOTHING, or EITHER."""
    system, limits = loaded.system, loaded.system.master.limits
    tick, rise = system.tick_period, limits.force_n * loaded.system.tick_period / (1e-3 * limits.ramp_ms)
    most_ms = system.link.silence_ms + 1e3 * (tick + STALL_S)
    assert loaded.device is not None
    wall_n = loaded.device.options.stiffness_n_m * WALL_M_S * tick  # type: ignore[attr-defined]
    approach_mm = 1e3 * (system.slave.limits.approach_speed_m_s * (tick + STALL_S) + CODING_M)
    is_silence, lag_mm = effect == SILENCE, 1e3 * LAG_M
    laws = (
        ("without a session, which was not due [ms]", found.away_ms, 0.0, effect == NOTHING),
        ("the fault had no effect, so nothing was shown", float(not found.away_ms), 0.0, is_silence),
        ("no session after the fault", float(found.back_ms is None), 0.0, True),
        ("force was on the hand after the last datagram for [ms]", found.force_ms, most_ms, is_silence),
        ("the robot moved after the last datagram for [ms]", found.robot_ms, most_ms, is_silence),
        ("change of the force in a tick [N]", found.step_n, wall_n * (1.0 + 1e-9), True),
        ("the force came back above its ramp [N]", found.early_n, rise, True),
        ("the robot came back in a tick by [mm]", found.step_mm, approach_mm, True),
        ("the robot backed off [mm]", found.backed_mm, 1e3 * system.slave.limits.retract_m + lag_mm, True),
        ("the robot moved otherwise [mm]", found.astray_mm, lag_mm, True),
        ("an end named no fault", float(not all(found.faults)), 0.0, is_silence),
    )
    return [f"{law}: {figure:.4g}, {most:.4g} allowed" for law, figure, most, holds in laws if holds and figure > most]
