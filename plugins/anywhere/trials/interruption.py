"""What hand and robot did while a path failed under a live session, and which promises of docs/safety.md were broken.

Both daemons run on this machine, so their records have one clock. `trials.safety` judges ramp, approach and retreat in
virtual time; here a tick may be late, as the host is.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from tests.program import ENGAGED, Records
from trials.safety.run import STILL, WALL_M_S
from weberlink.config import Configuration
from weberlink.telemetry.fault import Fault

SILENCE, NOTHING, EITHER = "silence", "nothing", "either"
STALL_S = 0.03  # by which a busy machine may delay a tick that reads what has arrived [s]


@dataclass(frozen=True)
class Interruption:
    """Of one run."""

    away_ms: float  # how long hand or robot were without a session
    back_ms: float | None  # from the end of the fault until both are in a session again; None if they are not
    # from the last datagram that a side heard to its last tick with force on the hand, or of the session in which the
    # robot moved
    force_ms: float
    robot_ms: float
    step_n: float  # largest change of force on the hand for each tick that passed, from the fault on
    faults: tuple[tuple[str, ...], ...]  # named by master and slave


def measure(master: Records, slave: Records, failed: float, restored: float) -> Interruption:
    """The figures of a run whose fault began in a session at `failed`, and was over at `restored` [s]."""
    gone = [side["at"][(side["at"] >= failed) & (side["state"] != ENGAGED)] for side in (master, slave)]
    is_back = master["state"][-1] == slave["state"][-1] == ENGAGED
    force = np.linalg.norm(master["output"], axis=1)
    moved = np.abs(np.diff(slave["output"], axis=0, prepend=slave["output"][:1])).max(axis=1)
    steps = np.abs(np.diff(force)) / np.diff(master["tick"].astype(np.int64))
    since = (side["fault"][side["at"] >= failed] for side in (master, slave))
    return Interruption(
        away_ms=1e3 * max(float(np.ptp(each)) if len(each) else 0.0 for each in gone),
        back_ms=1e3 * max((float(each[-1]) - restored for each in gone if len(each)), default=0.0) if is_back else None,
        force_ms=_acted_for(master, gone[0], force > STILL),
        robot_ms=_acted_for(slave, gone[1], (moved > STILL) & (slave["state"] == ENGAGED)),
        step_n=float(steps[master["at"][1:] >= failed].max()),
        faults=tuple(tuple(sorted(Fault(value).name.lower() for value in {*each.tolist()} - {0})) for each in since),
    )


def _acted_for(records: Records, gone: Any, acts: Any) -> float:
    """From the last datagram before the silence to the last of these ticks before the session is back [ms]."""
    if not len(gone):
        return 0.0
    at, heard = records["at"], np.diff(records["datagrams_received"].astype(np.int64), prepend=0) > 0
    last = at[heard & (at < gone[0])][-1]
    back = at[(at > gone[0]) & (records["state"] == ENGAGED)]
    acting = at[acts & (at > last) & (at < (back[0] if len(back) else np.inf))]
    return 1e3 * float(acting[-1] - last) if len(acting) else 0.0


def violated(found: Interruption, loaded: Configuration, effect: str) -> list[str]:
    """The promises that a run has broken; `effect` is what the fault must lead to: SILENCE, NOTHING, or EITHER."""
    tick = loaded.system.tick_period
    most_ms = loaded.system.link.silence_ms + 1e3 * (tick + STALL_S)
    assert loaded.device is not None
    wall_n = loaded.device.options.stiffness_n_m * WALL_M_S * tick  # type: ignore[attr-defined]
    is_silence = effect == SILENCE
    laws = (
        ("without a session, which was not due [ms]", found.away_ms, 0.0, effect == NOTHING),
        ("the fault had no effect, so nothing was shown", float(not found.away_ms), 0.0, is_silence),
        ("no session after the fault", float(found.back_ms is None), 0.0, True),
        ("force was on the hand after the last datagram for [ms]", found.force_ms, most_ms, is_silence),
        ("the robot moved after the last datagram for [ms]", found.robot_ms, most_ms, is_silence),
        ("change of the force in a tick [N]", found.step_n, wall_n * (1.0 + 1e-9), True),
        ("an end named no fault", float(not all(found.faults)), 0.0, is_silence),
    )
    return [f"{law}: {figure:.4g}, {most:.4g} allowed" for law, figure, most, holds in laws if holds and figure > most]
