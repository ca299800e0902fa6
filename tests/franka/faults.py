"""The faults of the trial: what is done to which process, and what must be true afterwards.

Each is done while the arm follows the hand. Afterwards the arm must come to rest, by what the simulator knows of its
joints, and the daemon must name the cause where it has to end.
"""

import signal
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from time import monotonic
from typing import Any

import numpy as np

from tests.franka.session import FrankaSession, alive, send
from weberlink.protocol.emulation import Emulation
from weberlink.system.configuration import MASTER, SLAVE

FOLLOW_S = 30.0
"""From a repaired fault to an arm that follows; imports take longest."""
REST_S, HOLD_S = 3.0, 1.0
"""In which the arm must rest after a fault, and for how long."""
STALL_S = 1.5
END_S = 5.0
"""In which a daemon that cannot go on must end."""
ORPHAN_S = 5.0
"""In which a controller without its daemon must end."""
RECOVER = "slave.robot.recover=true"


@dataclass
class Outcome:
    """What a fault did.

    Args:
        fault: name.
        rest_s: from the fault to joints at rest; None if they did not rest in time, or no robot was left to tell.
        travel_m: largest distance of the tip from where it was, until it rested.
        speed_rad_s: largest joint speed from the fault on.
        force_n: largest force on the table from the fault on.
        told: what the daemon said, if it ended.
        back_s: from the repair to an arm that follows again; None if it did not.
        broken: laws that did not hold.
    """

    fault: str
    rest_s: float | None = None
    travel_m: float = 0.0
    speed_rad_s: float = 0.0
    force_n: float = 0.0
    told: str = ""
    back_s: float | None = None
    broken: list[str] = field(default_factory=list)

    def to_dict(self) -> dict[str, Any]:
        return asdict(self)


@dataclass(frozen=True)
class Fault:
    """One kind.

    Args:
        strike: does it.
        repair: undoes it, so that the arm can follow again; returns what the slave said if it has ended.
        words: what the slave's daemon must say; empty if it must not end.
        robot: whether the robot is there to be looked at.
    """

    strike: Callable[[FrankaSession], None]
    repair: Callable[[FrankaSession], str]
    words: tuple[str, ...] = ()
    robot: bool = True


def _to_slave(number: signal.Signals) -> Callable[[FrankaSession], None]:
    def strike(at: FrankaSession) -> None:
        at.rig.signal(SLAVE, number)

    return strike


def _to_controller(number: signal.Signals) -> Callable[[FrankaSession], None]:
    def strike(at: FrankaSession) -> None:
        send(at.controller(), number)

    return strike


def _to_robot(number: signal.Signals) -> Callable[[FrankaSession], None]:
    def strike(at: FrankaSession) -> None:
        at.robot.signal(number)

    return strike


def _cut(at: FrankaSession) -> None:
    at.rig.wire.emulate(Emulation(loss=1.0))


def _reflex(at: FrankaSession) -> None:
    at.robot.provoke_reflex()


def _mend(at: FrankaSession) -> str:
    at.rig.wire.emulate(Emulation())
    return ""


def _wake(at: FrankaSession) -> str:
    at.rig.signal(SLAVE, signal.SIGCONT)
    return ""


def _start_slave(at: FrankaSession) -> str:
    at.end(SLAVE)
    at.rig.start(SLAVE, RECOVER)
    return ""


def _slave_ends(at: FrankaSession) -> str:
    """The slave's daemon must end by itself; another one takes over, and clears the robot's error."""
    told = at.wait_for_end(SLAVE, END_S)
    if told is None:
        at.end(SLAVE)
    at.rig.start(SLAVE, RECOVER)
    return "" if told is None else str(told["outcome"])


def _controller_wakes(at: FrankaSession) -> str:
    send(at.controller(), signal.SIGCONT)
    return _slave_ends(at)


def _robot_wakes(at: FrankaSession) -> str:
    at.robot.signal(signal.SIGCONT)
    return _slave_ends(at)


def _another_robot(at: FrankaSession) -> str:
    told = at.wait_for_end(SLAVE, END_S)
    at.restart_robot()
    at.end(SLAVE)
    at.rig.start(SLAVE, RECOVER)
    return "" if told is None else str(told["outcome"])


def _start_master(at: FrankaSession) -> str:
    at.end(MASTER)
    at.rig.start(MASTER)
    return ""


FAULTS = {
    "link cut": Fault(_cut, _mend),
    "master killed": Fault(lambda at: at.rig.signal(MASTER, signal.SIGKILL), _start_master),
    "slave stopped in order": Fault(_to_slave(signal.SIGTERM), _start_slave),
    "slave killed": Fault(_to_slave(signal.SIGKILL), _start_slave),
    "slave stalled": Fault(_to_slave(signal.SIGSTOP), _wake),
    "controller killed": Fault(_to_controller(signal.SIGKILL), _slave_ends, ("controller", "signal 9")),
    "controller stalled": Fault(_to_controller(signal.SIGSTOP), _controller_wakes, ("no new sample",)),
    "reflex": Fault(_reflex, _slave_ends, ("cartesian_reflex",)),
    "robot stalled": Fault(_to_robot(signal.SIGSTOP), _robot_wakes, ("no new sample",), robot=False),
    "robot killed": Fault(_to_robot(signal.SIGKILL), _another_robot, ("no new sample",), robot=False),
}


def inflict(name: str, at: FrankaSession) -> Outcome:
    """Do a fault to an arm that follows, look at the arm, repair, and wait until it follows again."""
    fault, outcome = FAULTS[name], Outcome(name)
    if at.wait_until_it_follows(FOLLOW_S) is None:
        outcome.broken.append(f"the arm did not follow before the fault{_said(at)}")
        return outcome
    controller, began = at.controller(), monotonic()
    fault.strike(at)
    if fault.robot:
        outcome.rest_s = at.robot.truth.seconds_to_rest(began, REST_S, HOLD_S)
        if outcome.rest_s is None:
            outcome.broken.append(f"the arm moved for more than {REST_S:g} s")
        _measure(outcome, at, began)
    else:
        at.watch(STALL_S)
    told = fault.repair(at)
    outcome.told = told
    missing = [word for word in fault.words if word not in told]
    if missing:
        outcome.broken.append(f"the slave said {told!r}, without {', '.join(missing)}")
    if name == "slave killed" and not _ends(controller, at):
        outcome.broken.append(f"the controller outlived its daemon by {ORPHAN_S:g} s")
    outcome.back_s = at.wait_until_it_follows(FOLLOW_S)
    if outcome.back_s is None:
        outcome.broken.append(f"the arm did not follow again{_said(at)}")
    return outcome


def _said(at: FrankaSession) -> str:
    """What the slave's daemon said if it has ended."""
    life = at.life(SLAVE)
    if life is None or life.daemon.running:
        return ""
    told = at.end(SLAVE)["outcome"]
    at.rig.start(SLAVE, RECOVER)
    return f", since the slave ended: {told}"


def _measure(outcome: Outcome, at: FrankaSession, began: float) -> None:
    rows = at.robot.truth.since(began)
    outcome.travel_m = float(np.linalg.norm(rows["tip"] - rows["tip"][0], axis=1).max())
    outcome.speed_rad_s = float(np.abs(rows["dq"]).max())
    outcome.force_n = float(np.linalg.norm(rows["force"], axis=1).max())


def _ends(pid: int | None, at: FrankaSession) -> bool:
    until = monotonic() + ORPHAN_S
    while alive(pid) and monotonic() < until:
        at.watch(0.05)
    return not alive(pid)
