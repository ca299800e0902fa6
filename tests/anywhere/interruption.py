"""What hand and robot did while a path failed under a live session, and which promises of docs/safety.md were broken.

Both daemons run on this machine, so their records have one clock. The bounds are those of `tests.safety.run`, which
judges the same promises in virtual time; here a tick may be late, as the host is.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from tests.anywhere.hosts import ENGAGED
from tests.program import Records
from tests.safety.run import CODING_M, STILL, WALL_M_S
from weberlink.system.configuration import Configuration
from weberlink.telemetry.fault import Fault

SILENCE, NOTHING, EITHER = "silence", "nothing", "either"
LAG_M = 0.002
"""How far the simulated robot (0.2 kg, critically damped, 3000 N/m) may be from its command in contact, because a
retreat counts from where the robot is: 5 N press it 1.7 mm away, and it lags a slide of 0.09 m/s by 16 ms, 1.5 mm."""
STALL_S = 0.03
"""By which a busy machine may delay a tick that reads what has arrived [s]."""


@dataclass(frozen=True)
class Interruption:
    """Of one run.

    Attributes:
        contact_n: force on the hand in the last tick before the fault.
        away_ms: how long hand or robot were without a session.
        back_ms: from the end of the fault until both are in a session again; None if they are not.
        force_ms: from the last datagram that the master heard to the last tick with force on the hand.
        robot_ms: from the last datagram that the slave heard to the last tick of the session in which the robot moved.
        retreat_mm: how far the robot backed off without a session, and how far it moved otherwise.
        step_n: largest change of force on the hand in a tick, from the fault on.
        early_n: how far the force was above an even rise to its limit, once the session was back.
        step_mm: largest step of the robot in a tick, once the session was back, less that of the hand.
        faults: named by master and slave.
        sessions: how often the master engaged again.
    """

    contact_n: float
    away_ms: float
    back_ms: float | None
    force_ms: float
    robot_ms: float
    retreat_mm: tuple[float, float]
    step_n: float
    early_n: float
    step_mm: float
    faults: tuple[tuple[str, ...], tuple[str, ...]]
    sessions: int


def measure(master: Records, slave: Records, failed: float, restored: float, loaded: Configuration) -> Interruption:
    """The figures of a run.

    Args:
        failed: when the fault began [s], in a session.
        restored: when it was over.
    """
    at, force = master["at"], np.linalg.norm(master["output"], axis=1)
    after = at >= failed
    away = np.concatenate([_outside(side, failed) for side in (master, slave)])
    returns = [_return(side, restored) for side in (master, slave)]
    back = None if None in returns else max(value for value in returns if value is not None)
    return Interruption(
        contact_n=float(force[~after][-1]),
        away_ms=1e3 * (max(_lasted(side, failed) for side in (master, slave)) if len(away) else 0.0),
        back_ms=None if back is None else 1e3 * max(0.0, back - restored),
        force_ms=1e3 * _since_heard(master, failed, force > STILL),
        robot_ms=1e3 * _since_heard(slave, failed, _moves(slave) & (slave["state"] == ENGAGED)),
        retreat_mm=_retreat(slave, failed),
        step_n=float(np.abs(np.diff(force[after])).max()),
        early_n=_early(master, force, failed, loaded),
        step_mm=1e3 * _step(slave, master, failed),
        faults=(_faults(master, failed), _faults(slave, failed)),
        sessions=int((np.diff((master["state"][after] == ENGAGED).astype(np.int8)) == 1).sum()),
    )


def violated(found: Interruption, loaded: Configuration, effect: str) -> list[str]:
    """The promises that a run has broken.

    Args:
        effect: what the fault must lead to: `SILENCE`, `NOTHING`, or `EITHER` of them.
    """
    system, limits = loaded.system, loaded.system.master.limits
    tick = system.tick_period
    most_ms = system.link.silence_ms + 1e3 * (tick + STALL_S)
    broken = []
    if effect == NOTHING and found.away_ms:
        broken.append(f"no session for {found.away_ms:.0f} ms, and none of it was due")
    if effect == SILENCE and not found.away_ms:
        broken.append("the fault had no effect, so nothing was shown")
    if found.back_ms is None:
        broken.append("no session after the fault")
    broken += [
        f"{what} {value:.0f} ms after the last datagram, {most_ms:.0f} ms allowed"
        for what, value in (("force was on the hand", found.force_ms), ("the robot moved", found.robot_ms))
        if effect == SILENCE and value > most_ms
    ]
    assert loaded.device is not None
    most_n = loaded.device.options.stiffness_n_m * WALL_M_S * tick  # type: ignore[attr-defined]
    # A tick left out by the host changes the force by two ticks' worth.
    if found.step_n > max(most_n, 2.0 * limits.force_n * tick / (1e-3 * limits.ramp_ms)):
        broken.append(f"the force changed by {found.step_n:.2f} N in a tick, {most_n:.2f} N allowed")
    if found.early_n > limits.force_n * tick / (1e-3 * limits.ramp_ms):
        broken.append(f"the force came back {found.early_n:.2f} N above its ramp")
    approach = 1e3 * (system.slave.limits.approach_speed_m_s * (tick + STALL_S) + CODING_M)
    if found.step_mm > approach:
        broken.append(f"the robot came back by {found.step_mm:.1f} mm in a tick, {approach:.1f} mm allowed")
    backed, otherwise = found.retreat_mm
    if backed > 1e3 * (system.slave.limits.retract_m + LAG_M) or otherwise > 1e3 * LAG_M:
        broken.append(f"the robot backed off {backed:.1f} mm, and moved {otherwise:.1f} mm otherwise")
    if effect == SILENCE and not all(found.faults):
        broken.append("an end named no fault")
    return broken


def _first_time(records: Records, since: float) -> Any:
    """Ticks from the fault until there is a session again; none if there was one all the time."""
    at, outside = records["at"], _outside(records, since)
    if not len(outside):
        return np.zeros(len(at), np.bool_)
    again = at[(at > outside[0]) & (records["state"] == ENGAGED)]
    return (at >= since) & (at < (again[0] if len(again) else np.inf))


def _alone(records: Records, since: float) -> Any:
    """Ticks without a session, from the fault on."""
    return (records["at"] >= since) & (records["state"] != ENGAGED)


def _outside(records: Records, since: float) -> Any:
    return records["at"][_alone(records, since)]


def _lasted(records: Records, since: float) -> float:
    outside = _outside(records, since)
    return float(outside[-1] - outside[0]) if len(outside) else 0.0


def _return(records: Records, restored: float) -> float | None:
    """First tick of the session that lasts until the end."""
    if records["state"][-1] != ENGAGED:
        return None
    outside = records["at"][records["state"] != ENGAGED]
    return max(restored, float(outside[-1])) if len(outside) else restored


def _since_heard(records: Records, failed: float, acts: Any) -> float:
    """From the last datagram before the silence to the last of these ticks before the session is back [s]."""
    at, window = records["at"], _first_time(records, failed)
    if not (window & acts).any():
        return 0.0
    heard = np.diff(records["datagrams_received"].astype(np.int64), prepend=0) > 0
    until = at[window & (records["state"] != ENGAGED)][0]
    return max(0.0, float(at[window & acts][-1] - at[heard & (at < until)][-1]))


def _moves(slave: Records) -> Any:
    """Ticks in which the robot is commanded to move."""
    return np.abs(np.diff(slave["output"], axis=0, prepend=slave["output"][:1])).max(axis=1) > STILL


def _retreat(slave: Records, since: float) -> tuple[float, float]:
    """How far the robot went up, away from the plane, and otherwise, in the first time without a session [mm]."""
    alone = slave["output"][_first_time(slave, since) & (slave["state"] != ENGAGED)]
    if len(alone) < 2:
        return 0.0, 0.0
    steps = np.diff(alone, axis=0)
    return 1e3 * float(alone[-1, 2] - alone[0, 2]), 1e3 * float(
        np.abs(steps[:, :2]).sum() - np.minimum(steps[:, 2], 0.0).sum()
    )


def _returned(records: Records, since: float) -> Any:
    """Ticks in a session that follow ticks without one, after the fault."""
    outside = _outside(records, since)
    later = records["at"] > (outside[-1] if len(outside) else np.inf)
    return later & (records["state"] == ENGAGED)


def _early(master: Records, force: Any, since: float, loaded: Configuration) -> float:
    limits, back = loaded.system.master.limits, _returned(master, since)
    if not back.any():
        return 0.0
    passed = master["at"][back] - master["at"][back][0] + loaded.system.tick_period
    return max(0.0, float((force[back] - limits.force_n * passed / (1e-3 * limits.ramp_ms)).max()))


def _step(slave: Records, master: Records, since: float) -> float:
    back = _returned(slave, since)
    if back.sum() < 2:
        return 0.0
    went = np.linalg.norm(np.diff(master["position"], axis=0), axis=1).max()
    moved = np.linalg.norm(np.diff(slave["output"][back], axis=0), axis=1).max()
    return max(0.0, float(moved - went))


def _faults(records: Records, since: float) -> tuple[str, ...]:
    values = set(records["fault"][records["at"] >= since].tolist()) - {0}
    return tuple(sorted(Fault(int(value)).name.lower() for value in values))
