"""Datagrams of some kinds are lost while all others pass: how long the robot follows into a contact that nobody feels.

python -m trials.safety.streams
"""

import argparse
import sys
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from itertools import combinations, product
from math import inf
from os import cpu_count
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tests.program import Records
from tests.protocol.harness import kind_of
from tests.safety.observed_link import ObservedLink, agreed_by, observed
from tests.session.systems import ARMS, HAS_ARMS, configuration
from weberlink.protocol.emulation import Emulation
from weberlink.protocol.wire import Kind
from weberlink.session.simulation import as_array
from weberlink.telemetry.fault import Fault
from weberlink.telemetry.record import FORCE

BEGIN, LASTS, AFTER = 1.5, 2.5, 0.7  # when the kinds begin to be lost, for how long, and how long all pass again [s]
DELAY_S = 0.005  # one way
ENDS = MASTER, SLAVE = ("master", "slave")  # by what they send
TICKS_MS = 12.0  # added to the limit: what is in the air, and the ticks of both ends [ms]
Lost = tuple[tuple[str, Kind], ...]  # sender and kind of the datagrams that are lost


@dataclass(frozen=True)
class Session:
    """A session whose robot meets a contact and leaves it again and again."""

    file: str | Path
    overrides: tuple[str, ...]  # the link is not encrypted, so that the kinds can be read
    kinds: tuple[Kind, ...] = (Kind.UPDATE,)  # that it sends updates with
    is_arm: bool = False
    least: tuple[float, float] = (1.0, 0.02)  # contact that counts, and what is nothing on the hand [N, or N m]

    def size(self, records: Records, column: str) -> NDArray[np.float64]:
        """Length of each vector; of an arm, its largest axis."""
        values = records[column]
        return np.abs(values).max(axis=1) if self.is_arm else np.linalg.norm(values[:, FORCE], axis=1)


def repeated(first: str, *steps: str) -> str:
    return f"master.device.script=[{', '.join((first, *steps * 9))}]"


OPEN = ("link.listen=127.0.0.1:0", "link.slave=127.0.0.1:0", "link.security=none")
TOUCH = (*OPEN, "slave.limits.on_silence=retract", "codec.force.predictor=zoh", "codec.position.predictor=zoh")
"""So that every contact needs updates, and a robot that nobody leads does not stay in it."""
HAND = repeated(
    "{motion: reach, to_m: [0, 0, 0.02], duration_s: 0.5}",
    "{motion: reach, to_m: [0, 0, -0.02], duration_s: 0.3}",
    "{motion: reach, to_m: [0.02, 0, 0.02], duration_s: 0.3}",
)
TURNING = repeated(
    "{motion: reach, to_m: [-0.01, -0.05, 0.02], duration_s: 0.5}",
    "{motion: reach, to_m: [-0.01, -0.05, -0.015], turn_deg: [0, 20, 0], duration_s: 0.3}",
    "{motion: reach, to_m: [-0.01, -0.05, 0.02], turn_deg: [0, 0, 0], duration_s: 0.3}",
)
ARM = repeated(
    "{motion: move, duration_s: 0.5, gripper_rad: 0.8}",
    "{motion: move, duration_s: 0.4, joints_rad: [0, 0.06, 0.335, 1.005, 0], gripper_rad: 0.6}",
    "{motion: move, duration_s: 0.4, joints_rad: [0, 0.018, -0.214, 1.597, 0], gripper_rad: 0.8}",
)
TWO = (Kind.UPDATE, Kind.SECOND_UPDATE)
SESSIONS = {
    "hand, none": Session("loopback.yaml", (*TOUCH, HAND, "control.scheme=none")),
    "hand, bounded": Session("loopback.yaml", (*TOUCH, HAND, "control.scheme=bounded")),
    "hand with torque": Session("rotation.yaml", (*TOUCH, TURNING), TWO),
    **({"arm": Session(ARMS, (*OPEN, ARM), TWO, True, (0.2, 0.004))} if HAS_ARMS else {}),
}


def losses(kinds: tuple[Kind, ...]) -> Iterator[Lost]:
    single = list(product(ENDS, (*kinds, Kind.HEARTBEAT, Kind.CHANGE)))
    yield from ((each,) for each in single)
    yield from combinations(single, 2)


@dataclass(frozen=True)
class Found:
    unfelt_ms: int  # longest time in which the robot followed in a contact with nothing on the hand
    alone_ms: int  # longest time in which the robot stood or followed so
    limit_ms: float  # S and the agreed round trip
    stopped_ms: float  # how long after the first loss the robot last followed; inf if it did to the end
    faults: tuple[tuple[str, ...], ...]  # of master and slave, by name
    is_back: bool  # whether both ends work again at the end


def run(name: str, lost: Lost) -> Found:
    session = SESSIONS[name]
    lost_at: list[float] = []

    def link_of(end: str) -> ObservedLink:
        kinds = {int(kind) for sender, kind in lost if sender == end}

        def hold(data: bytes, now: float) -> float | None:
            if not (BEGIN <= now < BEGIN + LASTS and kind_of(data) in kinds):
                return None
            lost_at.append(now)
            return inf

        return ObservedLink(Emulation(delay_s=DELAY_S), hold=hold)

    simulation = observed(configuration(*session.overrides, file=session.file), *map(link_of, ENDS))
    records, follows, round_trip = [], [], 0.0
    for _ in range(round((BEGIN + LASTS + AFTER) * 1e3)):
        records.append(simulation.step())
        follows.append(simulation.slave.engaged)
        round_trip = max(round_trip, agreed_by(simulation))
    master, slave = (as_array(side) for side in zip(*records, strict=True))
    followed, failing = np.array(follows), (master["at"] >= BEGIN) & (master["at"] < BEGIN + LASTS)
    most, nothing = session.least
    unfelt = failing & (session.size(slave, "raw") > most) & (session.size(master, "output") < nothing)
    last = master["at"][followed & failing][-1]
    return Found(
        longest(unfelt & followed),
        longest(unfelt),
        1e3 * (0.1 + round_trip),
        inf if last > BEGIN + LASTS - 2e-3 else 1e3 * float(last - lost_at[0]),
        tuple(
            tuple(sorted(Fault(each).name.lower() for each in set(side["fault"][failing].tolist()) - {0}))
            for side in (master, slave)
        ),
        bool(followed[-1] and simulation.master.engaged),
    )


def longest(flags: NDArray[np.bool_]) -> int:
    edges = np.flatnonzero(np.diff(np.concatenate(([0], flags.astype(int), [0]))))
    return int(np.diff(edges)[::2].max(initial=0))


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--only", default="", metavar="TEXT", help="sessions whose names contain this text")
    parser.add_argument("--workers", type=int, default=cpu_count() or 1)
    chosen = parser.parse_args()
    todo = [(name, lost) for name, session in SESSIONS.items() if chosen.only in name for lost in losses(session.kinds)]
    broken = False
    print("| session | lost | followed unfelt | unfelt | limit | followed for | faults of master, slave | back |")
    print("|---|---|---:|---:|---:|---:|---|---|")
    with ProcessPoolExecutor(chosen.workers) as pool:
        for (name, lost), found in zip(todo, pool.map(run, *zip(*todo, strict=True)), strict=True):
            what = " and ".join(f"{kind.name.lower()} of {sender}" for sender, kind in lost)
            faults = ", ".join("/".join(each) or "none" for each in found.faults)
            times = f"{found.unfelt_ms} | {found.alone_ms} | {found.limit_ms:.0f} | {found.stopped_ms:.0f}"
            print(f"| {name} | {what} | {times} | {faults} | {found.is_back} |")
            # An arm holds where it is, also in a contact; the robot of a hand retracts in these sessions.
            unfelt_ms = found.unfelt_ms if SESSIONS[name].is_arm else found.alone_ms
            broken |= unfelt_ms > found.limit_ms or not found.is_back
    return int(broken)


if __name__ == "__main__":
    sys.exit(main())
