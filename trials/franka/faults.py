"""The faults of the trial: what is done to which process, and what must be true afterwards.

Each is done while the arm follows the hand. Afterwards the arm must come to rest, by what the simulator knows of its
joints, and the daemon must name the cause where it has to end.
"""

import os
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from signal import SIGCONT, SIGKILL, SIGSTOP, SIGTERM, SIGUSR1
from time import monotonic, sleep
from types import TracebackType
from typing import Self

import numpy as np

from tests.program import ENGAGED
from trials.franka.robot import SimulatedRobot
from trials.rig import CONFIGS, Session, within
from weberlink.config import MASTER, SLAVE
from weberlink.protocol.emulation import Emulation

CONTROLLER = b"weberlink_franka.controller"
FOLLOW_S = 30.0  # from a repaired fault to an arm that follows; imports take longest
REST_S, HOLD_S = 3.0, 1.0  # in which the arm must rest after a fault, and for how long
STALL_S = 1.5
END_S = 5.0  # in which a daemon that cannot go on must end, or a controller without its daemon
FRESH_S = 0.5
MOVES_RAD_S = 0.02  # joint speed above which the arm follows the hand


class FrankaSession(Session):
    """Both daemons before a simulated robot."""

    def __init__(self, folder: Path, host: str, seed: int, lenient: bool, overrides: Sequence[str]) -> None:
        self._make_robot = partial(SimulatedRobot, folder, host, lenient)
        file = CONFIGS.parent / "plugins/franka/configs/franka.yaml"
        super().__init__(file, seed=seed, overrides=(f"slave.robot.host={host}", *overrides))

    def __enter__(self) -> Self:
        self.robot = self._make_robot()
        return super().__enter__()

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        super().__exit__(kind, error, at)
        self.robot.close()

    def restart_robot(self) -> None:
        """Another robot in the place of this one."""
        self.robot.close()
        self.robot = self._make_robot()

    def restart(self, side: str) -> str:
        """Another daemon, which clears the robot's error; what the former one said."""
        before = self.sides[side]
        before.end()
        outcome = before.outcome
        self.start(side, *["slave.robot.recover=true"] * (side == SLAVE))
        return outcome

    def follows(self) -> bool:
        """Whether both sides are in the session and the arm moves."""
        for side in self.sides.values():
            last = None if side.ring is None else side.ring.last
            if last is None or last["state"] != ENGAGED or monotonic() - float(last["at"]) > FRESH_S:
                return False
        row = self.robot.latest()
        return bool(row["moving"]) and float(np.abs(row["dq"]).max()) > MOVES_RAD_S

    def seconds_until_it_follows(self) -> float | None:
        """Until the arm follows the hand; None if it does not in time."""
        began = monotonic()
        return monotonic() - began if within(FOLLOW_S, self.follows) else None

    def controller(self) -> int:
        """Process id of the controller that the slave's daemon has started; 0 if there is none."""
        for tasks in Path(f"/proc/{self.sides[SLAVE].daemon}/task").glob("*/children"):
            with suppress(OSError):  # the thread has ended meanwhile
                for pid in map(int, tasks.read_text(encoding="utf-8").split()):
                    if CONTROLLER in Path(f"/proc/{pid}/cmdline").read_bytes():
                        return pid
        return 0


def is_alive(pid: int) -> bool:
    """Whether a process runs; a zombie does not."""
    try:
        return Path(f"/proc/{pid}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


@dataclass
class Outcome:
    """What a fault did."""

    fault: str  # name
    # from the fault to joints at rest; None if they did not rest in time, or no robot was left to tell
    rest_s: float | None = None
    travel_m: float = 0.0  # largest distance of the tip from where it was, until it rested
    speed_rad_s: float = 0.0  # largest joint speed from the fault on
    force_n: float = 0.0  # largest force on the table from the fault on
    told: str = ""  # what the daemon said, if it ended
    back_s: float | None = None  # from the repair to an arm that follows again; None if it did not
    broken: list[str] = field(default_factory=list)  # laws that did not hold


Deed = Callable[[FrankaSession], object]


def to_slave(number: int) -> Deed:
    return lambda at: at.sides[SLAVE].signal(number)


def to_controller(number: int) -> Deed:
    def act(at: FrankaSession) -> None:
        if pid := at.controller():  # it ends with its daemon
            os.kill(pid, number)

    return act


def to_robot(number: int) -> Deed:
    return lambda at: at.robot.signal(number)


def emulate(emulation: Emulation) -> Deed:
    return lambda at: at.wire.emulate(emulation)


@dataclass(frozen=True)
class Fault:
    """One kind."""

    strike: Deed  # does it
    # undoes it, so that the arm can follow again; then the slave is replaced if it has to end
    repair: Deed = lambda _: None
    words: tuple[str, ...] = ()  # what the slave's daemon must say; empty if it must not end
    is_robot_there: bool = True  # to be looked at


NO_SAMPLE = ("no new sample",)
FAULTS = {
    "link cut": Fault(emulate(Emulation(loss=1.0)), emulate(Emulation())),
    "master killed": Fault(lambda at: at.sides[MASTER].signal(SIGKILL), lambda at: at.restart(MASTER)),
    "slave stopped in order": Fault(to_slave(SIGTERM), lambda at: at.restart(SLAVE)),
    "slave killed": Fault(to_slave(SIGKILL), lambda at: at.restart(SLAVE)),
    "slave stalled": Fault(to_slave(SIGSTOP), to_slave(SIGCONT)),
    "controller killed": Fault(to_controller(SIGKILL), words=("controller", "signal 9")),
    "controller stalled": Fault(to_controller(SIGSTOP), to_controller(SIGCONT), NO_SAMPLE),
    "reflex": Fault(to_robot(SIGUSR1), words=("cartesian_reflex",)),
    "robot stalled": Fault(to_robot(SIGSTOP), to_robot(SIGCONT), NO_SAMPLE, is_robot_there=False),
    "robot killed": Fault(to_robot(SIGKILL), lambda at: at.restart_robot(), NO_SAMPLE, is_robot_there=False),
}


def inflict(name: str, at: FrankaSession) -> Outcome:
    """Do a fault to an arm that follows, look at the arm, repair, and wait until it follows again."""
    fault, outcome = FAULTS[name], Outcome(name)
    if at.seconds_until_it_follows() is None:
        outcome.broken.append(f"the arm did not follow before the fault: {at.sides[SLAVE].outcome}")
        return outcome
    controller, began = at.controller(), monotonic()
    fault.strike(at)
    if fault.is_robot_there:
        outcome.rest_s = at.robot.seconds_to_rest(began, REST_S, HOLD_S)
        if outcome.rest_s is None:
            outcome.broken.append(f"the arm moved for more than {REST_S:g} s")
        rows = at.robot.since(began)
        outcome.travel_m = float(np.linalg.norm(rows["tip"] - rows["tip"][0], axis=1).max())
        outcome.speed_rad_s = float(np.abs(rows["dq"]).max())
        outcome.force_n = float(np.linalg.norm(rows["force"], axis=1).max())
    else:
        sleep(STALL_S)
    fault.repair(at)
    if fault.words:  # the slave's daemon must end by itself, and another one takes over
        ended, told = at.sides[SLAVE].ends(END_S), at.restart(SLAVE)
        outcome.told = told if ended else ""
    if missing := [word for word in fault.words if word not in outcome.told]:
        outcome.broken.append(f"the slave said {outcome.told!r}, without {', '.join(missing)}")
    if name == "slave killed" and not within(END_S, lambda: not is_alive(controller)):
        outcome.broken.append(f"the controller outlived its daemon by {END_S:g} s")
    outcome.back_s = at.seconds_until_it_follows()
    if outcome.back_s is None:
        outcome.broken.append(f"the arm did not follow again: {at.sides[SLAVE].outcome}")
    return outcome
