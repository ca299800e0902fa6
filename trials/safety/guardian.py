"""`python -m trials.safety.guardian`: how long the force of each guarded board stays, however its session ends.

Sessions of real processes on emulated boards; arms are led by a process that only pushes. Exit 1 where a force stays
for longer than the page of its board says.
"""

import argparse
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from math import inf
from pathlib import Path
from tempfile import TemporaryDirectory
from time import monotonic, sleep
from typing import Any

import yaml

from plugins.arms.tests.test_host_that_ends import FAMILIES, arm_that_is_led, push
from tests.confined import NAMESPACE, ControlGroup, control_group
from tests.hardware.test_guardian import TAKE_OFF, Service, serving
from tests.program import ROOT
from trials.rig import within
from weberlink.geometry.vector import norm
from weberlink.master.devices import DEVICES
from weberlink.realtime.process import prepare
from weberlink.testing.serving import PtyDevice
from weberlink.testing.wires import emulated
from weberlink_devices.inverse3.websocket_device import WebSocketDevice
from weberlink_devices.umockdev import Testbed, TestbedNode
from weberlink_figures.environment import environment, footer

OWN, SERVICE = "of the session", "service"
REFUSED, GOES_ON, STAYS, ENDED = "refused", "goes on", "stays", "ended soon after its start"
MARK = "WEBERLINK_TRIAL"  # in the environment of a session and of its guardian: the folder of the run
FOR_S, AFTER_S = 2.0, 0.3  # how long a force is waited for to end, and for how long it must be gone [s]
STARTS, STARTS_S = 4, 30.0
DAEMONS = ("weberlink.session.daemon master", ".tests.test_host_that_ends")
"""In the command line of the process that commands a board."""
PLANE = {"shape": "plane", "stiffness_n_m": 300.0}


@dataclass(frozen=True)
class Board:
    """A guarded board: its limit [ms], and where the hand presses into a plane."""

    name: str
    limit_ms: float
    normal: tuple[float, float, float] = (0.0, 0.0, 1.0)
    axes: str = "xyz"
    options: dict[str, Any] = field(default_factory=dict)  # of the driver


BOARDS = (
    Board("haply_2diy", 100.0, (0.0, -1.0, 0.0), "xy", {"reply_ms": 100.0}),
    Board("inverse3", 100.0, options={"reply_ms": 100.0}),
    Board("polhem_hid", 100.0),
    Board("so101_leader", 130.0),
    Board("so101_follower", 250.0),  # 130 ms until its goals are where it is, and what the servos need to ease off
)


@dataclass
class Pushing:
    launcher: subprocess.Popen[bytes]
    force: Callable[[], float]  # beyond what remains without a motor
    group: ControlGroup
    service: Service | None
    guardian: int

    def daemon(self) -> int:
        return next(pid for pid in self.group.processes if any(word in line(pid) for word in DAEMONS))

    def kill_all(self, *others: int) -> None:
        for pid in (*others, *self.group.processes):
            signalled(pid, signal.SIGKILL)

    def end_unit(self) -> None:
        assert self.service is not None
        signalled(self.guardian, signal.SIGSTOP)
        self.kill_all(self.guardian, self.service.process.pid)
        subprocess.Popen((sys.executable, *TAKE_OFF, str(self.service.folder)), stderr=subprocess.DEVNULL)


def line(pid: int) -> str:
    """The command line of a process; empty for one that has ended."""
    with suppress(OSError):
        return Path(f"/proc/{pid}/cmdline").read_bytes().replace(b"\0", b" ").decode()
    return ""


def signalled(pid: int, number: signal.Signals) -> None:
    with suppress(ProcessLookupError):
        os.kill(pid, number)


DEEDS: dict[str, Callable[[Pushing], object]] = {
    "daemon killed": lambda on: signalled(on.daemon(), signal.SIGKILL),
    "daemon stopped": lambda on: signalled(on.daemon(), signal.SIGSTOP),
    "launcher killed": lambda on: on.launcher.kill(),
    "launcher stopped": lambda on: on.launcher.send_signal(signal.SIGSTOP),
    "guardian killed": lambda on: signalled(on.guardian, signal.SIGKILL),
    "guardian stopped": lambda on: signalled(on.guardian, signal.SIGSTOP),
    "launcher, then the rest": lambda on: (on.launcher.kill(), on.kill_all()),
    "control group killed": lambda on: on.group.kill(),
    "control group frozen": lambda on: on.group.freeze(),
    "PID namespace ended": lambda on: on.launcher.kill(),
    "all but the service killed": lambda on: on.kill_all(*(() if on.service else (on.guardian,))),
    "all killed, then ExecStopPost=": Pushing.end_unit,
}
NOT_PROMISED = {(OWN, "all but the service killed"): STAYS, (OWN, "PID namespace ended"): REFUSED}
SLOWER_MS = {"guardian stopped": 400.0, "launcher killed": 1000.0, "all killed, then ExecStopPost=": 2000.0}
"""A stopped guardian is noticed after 250 ms; a launcher's end is an orderly end of the session, by its own limits."""


@contextmanager
def plugged(board: Board, folder: Path) -> Iterator[tuple[list[str], dict[str, str], Callable[[], float]]]:
    """The emulated board: a command that pushes with it, the environment for that, and the force beyond what may be."""

    def hurry() -> None:
        prepare(60, lock_memory=False, cpu=None)

    if board.name.startswith("so101"):
        family = next(each for each in FAMILIES.values() if each.driver == board.name)
        options = {} if family.leads else {"gravity": False}
        with arm_that_is_led(family._replace(options=options), folder) as (command, arm):
            yield command, {}, lambda: push(arm, family) - family.left
        return
    inwards = [-0.02 * part for part in board.normal]
    rest, reach = {"motion": "rest", "duration_s": 0.5}, {"motion": "reach", "to_m": inwards, "duration_s": 1.0}
    emulator = emulated(board.name, handle={"script": [rest, reach, rest | {"duration_s": 1e3}]})
    with ExitStack() as stack:
        changes = dict[str, str]()
        if board.name == "inverse3":
            port = stack.enter_context(WebSocketDevice(emulator, begin=hurry)).address
        elif board.name == "polhem_hid":
            bed = stack.enter_context(Testbed(60))
            port, changes = stack.enter_context(TestbedNode(bed, emulator, begin=hurry)).node, bed.environment
        else:
            port = str(stack.enter_context(PtyDevice(emulator, folder / "board", begin=hurry)).path)
        driver: Any = DEVICES.load(board.name)
        signs = driver.fingerprint(driver.Options(**board.options))
        device = {"driver": board.name, "port": port, "signs_checked": signs, **board.options}
        plane = {**PLANE, "point_m": [0.5 * part for part in inwards], "normal": list(board.normal)}
        file = folder / "session.yaml"
        whole = {
            "axes": board.axes,
            "link": {"listen": "127.0.0.1:0", "slave": "127.0.0.1:0", "security": "session"},
            "master": {"device": device, "limits": {"force_n": 2, "device_ms": 100}},
            "slave": {"robot": {"driver": "point"}, "scene": [plane]},
        }
        file.write_text(yaml.safe_dump(whole), encoding="utf-8")
        yield [sys.executable, "-m", "weberlink", "loopback", str(file)], changes, lambda: norm(emulator.force) - 0.01


def guardian_of(folder: Path) -> int | None:
    """That of the device of the session whose environment names this folder."""
    for each in Path("/proc").glob("[0-9]*"):
        with suppress(OSError):
            told = (each / "environ").read_bytes().split(b"\0")
            if "guardian_process.py one" in line(int(each.name)) and f"{MARK}={folder}".encode() in told:
                return int(each.name)
    return None


def stays(board: Board, kind: str, deed: str) -> float | str:
    """How long the force stays [ms], or in words."""
    with ExitStack() as stack:
        folder = Path(stack.enter_context(TemporaryDirectory(prefix="weberlink-trial-")))
        service = stack.enter_context(serving(folder)) if kind == SERVICE else None
        if service is not None:
            with suppress(OSError):  # as its unit
                os.sched_setscheduler(service.process.pid, os.SCHED_FIFO, os.sched_param(98))
        group = stack.enter_context(control_group())
        if group is None:
            return "not tried: this user may make no control group"
        command, changes, force = stack.enter_context(plugged(board, folder))
        prefix = (*group.prefix, *(NAMESPACE if deed.startswith("PID") else ()))
        changes |= {"WEBERLINK_GUARDIAN": "" if service is None else str(service.socket), MARK: str(folder)}
        session = stack.enter_context(
            subprocess.Popen(
                (*prefix, "env", *(f"{name}={value}" for name, value in changes.items()), *command),
                **{"cwd": ROOT, "stdin": subprocess.DEVNULL, "stdout": subprocess.PIPE, "stderr": subprocess.STDOUT},
            )
        )
        stack.callback(group.kill)
        if not within(STARTS_S, lambda: force() > 0.0 or session.poll() is not None) or session.poll() is not None:
            said = session.communicate()[0].decode() if session.poll() is not None else "does not push"
            return REFUSED if "in this container" in " ".join(said.split()) else said
        sleep(0.3)
        leases = () if service is None else service.leases
        guardian = guardian_of(folder) if service is None else max((int(each.stem) for each in leases), default=None)
        while force() <= 0.0 and session.poll() is None:  # it may bounce
            sleep(2e-4)
        if guardian is None or session.poll() is not None:
            return ENDED
        stack.callback(signalled, guardian, signal.SIGKILL)
        began = ended = monotonic()
        try:
            DEEDS[deed](Pushing(session, force, group, service, guardian))
        except StopIteration:  # the daemon has ended
            return ENDED
        while (now := monotonic()) < min(began + FOR_S, ended + AFTER_S):
            ended = now if force() > 0.0 else ended
            sleep(2e-4)
        stayed = GOES_ON if deed == "launcher stopped" else STAYS
        return stayed if now >= began + FOR_S else (ended - began) * 1e3


def tried(board: Board, kind: str, deed: str) -> float | str:
    """As `stays`; a session that fails at its start on a busy machine is begun again."""
    for _ in range(STARTS):
        seen = stays(board, kind, deed)
        if not isinstance(seen, str) or seen in (REFUSED, GOES_ON, STAYS):
            return seen
    return seen


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--boards", nargs="*", default=[each.name for each in BOARDS])
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--deeds", nargs="*", default=list(DEEDS), help="of the columns")
    given, bad = parser.parse_args(), 0
    with suppress(OSError):  # so that a busy machine does not lengthen what is measured
        os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(60))
    print(f"| board | guardian | {' | '.join(given.deeds)} |\n|---|---|{'---:|' * len(given.deeds)}")
    for board in (each for each in BOARDS if each.name in given.boards):
        for kind in (OWN, SERVICE):
            cells = []
            for deed in given.deeds:
                if (deed.startswith("launcher") and board.name.startswith("so101")) or (
                    kind == OWN and deed.startswith("all killed")
                ):
                    cells.append("-")
                    continue
                seen = [tried(board, kind, deed) for _ in range(given.repeats)]
                times = [each for each in seen if isinstance(each, float)]
                words = sorted({each for each in seen if isinstance(each, str)})
                expected = [NOT_PROMISED.get((kind, deed)), GOES_ON if deed == "launcher stopped" else None]
                limit = inf if expected[0] else SLOWER_MS.get(deed, board.limit_ms)  # a board may end it itself
                is_bad = any(each > limit for each in times) or any(each not in expected for each in words)
                bad += is_bad
                text = ", ".join([*([f"{max(times):.0f} ms"] if times else []), *words])
                cells.append(f"{'**' if is_bad else ''}{text}{'**' if is_bad else ''}")
            print(f"| {board.name} | {kind} | {' | '.join(cells)} |", flush=True)
    print(f"\nLongest of {given.repeats} each. {footer(environment())}")
    return min(bad, 1)


if __name__ == "__main__":
    sys.exit(main())
