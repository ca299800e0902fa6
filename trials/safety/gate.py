"""What leaves at either end against a peer that holds the keys and says what it likes: the largest of every limit.

python -m trials.safety.gate --updates 100000
"""

import argparse
import sys
from concurrent.futures import ProcessPoolExecutor
from itertools import product
from math import dist, hypot
from os import cpu_count
from random import Random
from typing import Any

from tests.session.hostile import Content, Duel
from tests.session.systems import ARMS, HAS_ARMS, configuration
from weberlink.geometry.joints import Joints
from weberlink.geometry.rotation import angle_between
from weberlink.slave.guard import Follower

KINDS: dict[str, tuple[Any, ...]] = {
    "hand": ("loopback.yaml",),
    "hand, slew 50 N/s": ("loopback.yaml", "master.limits.slew_n_s=50"),
    "hand with torque": ("rotation.yaml", "link.playout_ms=20"),
    **({"arm": (ARMS,)} if HAS_ARMS else {}),
}
"""A file and its overrides; `control.scheme: none` leaves all bounds to the gate."""
OVERRIDES = ("link.security=none", "link.listen=127.0.0.1:0", "link.slave=127.0.0.1:0", "control.scheme=none")
ENDS = ("master", "slave")
LARGEST = 2**15 - 1
LEVELS = (-LARGEST, -1, 0, 1, LARGEST)
Largest = dict[str, tuple[float, float]]  # by limit: the limit, and the largest value that left


class Muted(Duel):
    """A duel whose link can fall silent, and whose own end can stand still."""

    silent = False

    def carry(self) -> None:
        if not self.silent:
            super().carry()
            return
        self.peer.handle_timer(self.now)
        self.peer.datagrams_to_send()
        self.side.endpoint.datagrams_to_send()


class Watch:
    def __init__(self, duel: Duel) -> None:
        self._side = duel.side
        self._port: Any = duel.side.port
        self.largest: Largest = {}
        self._sent: list[list[Joints]] = []
        if self._port.leads:
            for display in self._port.displays:
                display._write = self._tap(display._write)
        else:
            self._port._command = self._tap(self._port._command)
            if getattr(self._port, "tool", None) is not None:
                self._port._point = self._tap(self._port._point)
        self._last: list[Joints] = []

    def _tap(self, write: Any) -> Any:
        sent: list[Joints] = []
        self._sent.append(sent)

        def tapped(values: Joints, now: float) -> None:
            sent.append(values)
            if write is not None:
                write(values, now)

        return tapped

    def _note(self, name: str, limit: float, value: float) -> None:
        before = self.largest.get(name)
        if before is None or value * max(before[0], 1e-12) > before[1] * max(limit, 1e-12):  # nearest to its limit
            self.largest[name] = limit, value

    def look(self, now: float) -> None:
        newest = [sent[-1] for sent in self._sent if sent]
        for sent in self._sent:
            del sent[:-1]
        if self._last and newest:
            (self._look_at_hand if self._port.leads else self._look_at_robot)(newest, now)
        self._last = newest

    def _look_at_hand(self, newest: list[Joints], now: float) -> None:
        step, gate = self._side.pace.step, self._port.gate
        ramp, silence = gate.ramp, gate.silence
        values, before = (sum(each, ()) for each in (newest, self._last))
        first = 0
        for index, bound in enumerate(gate.bounds):
            for most, slew in zip(bound.most, bound.slew, strict=True):
                here, there = before[first : first + bound.width], values[first : first + bound.width]
                first += bound.width
                name = ("force", "torque")[index] if bound.width == 3 else "torque of an axis"
                self._note(f"{name}: largest [N, N m]", most, hypot(*there))
                if now - self._side.endpoint.liveness.in_touch_at >= silence:
                    self._note(f"{name}: after the silence limit [N, N m]", 0.0, hypot(*there))
                if step > 0.0:
                    growth = (hypot(*there) - hypot(*here)) / step
                    self._note(f"{name}: change but for a fade [per s]", slew, beyond_a_fade(here, there) / step)
                    if gate.gain < 1.0:
                        self._note(f"{name}: growth in a fade [per s]", most / ramp, growth)

    def _look_at_robot(self, newest: list[Joints], now: float) -> None:
        guard, step, liveness = self._port.guard, self._side.pace.step, self._side.endpoint.liveness
        before, values = self._last[0], newest[0]
        out = max(max(low - x, x - high) for x, low, high in zip(values, guard.lower, guard.upper, strict=True))
        self._note("outside of where it may be [m, rad]", 0.0, max(0.0, out))
        moved = max(dist(before[first:last], values[first:last]) for first, last in guard.spans)
        self._look_at_motion("robot" if len(guard.spans) == 1 else "an axis", moved, guard, step)
        if now > liveness.silent_at and not guard.tripped:
            self._note("motion after the silence limit [m, rad]", 0.0, moved)
        if len(newest) > 1:
            turned: Any = self._last[1], newest[1]
            self._look_at_motion("tool", angle_between(*turned), self._port.tool, step)

    def _look_at_motion(self, name: str, moved: float, follower: Follower, step: float) -> None:
        if step > 0.0:
            self._note(f"{name}: speed [per s]", follower.speed, moved / step)
            if not follower.arrived:
                self._note(f"{name}: speed of an approach [per s]", follower.approach_speed, moved / step)


def beyond_a_fade(before: Joints, after: Joints) -> float:
    """The change that no fade of what was before explains: the distance to the way from there to nothing."""
    square = sum(value * value for value in before)
    if square == 0.0:
        return hypot(*after)
    share = sum(a * b for a, b in zip(before, after, strict=True)) / square
    share = min(1.0, max(0.0, share))
    return dist(after, tuple(share * value for value in before))


def run(kind: str, end: str, seed: int, updates: int) -> Largest:
    file, *overrides = KINDS[kind]
    duel, draw = Muted(configuration(*OVERRIDES, *overrides, file=file), end), Random(f"{kind} {end} {seed}")
    duel.engage()
    watch = Watch(duel)
    sent = 0
    while sent < updates and not duel.side.stopped:
        mood = draw.choices(("flood", "jumps", "toggles", "silence", "stall", "renews"), (4, 4, 4, 2, 1, 1))[0]
        level, flips = draw.choice(LEVELS), draw.randint(1, 40)
        match mood:
            case "stall":
                duel.index += draw.randint(10, 150)
            case "renews":
                duel.renew(draw.choice((None, "bye")))
        for tick in range(draw.randint(1, 200)):
            duel.silent = mood == "silence"
            encodes = mood != "toggles" or tick // flips % 2 == 0
            duel.peer.report_encoding(duel.now, is_encoding=encodes)
            for _ in range(draw.randint(1, 4) if encodes else 0):
                if mood == "flood":
                    level = draw.choice(LEVELS) if draw.random() < 0.5 else draw.randint(-LARGEST, LARGEST)
                elif tick % flips == 0:
                    level = -level
                levels = (level, draw.choice((0, level, -level)), draw.choice((0, level)))
                sent += duel.update(
                    Content(draw.randint(0, 1), draw.randint(0, 7), draw.randint(-90, 100), levels, None)
                )
            now = duel.now
            duel.tick()
            watch.look(now)
            if sent >= updates:
                break
    return watch.largest


def cases() -> list[tuple[str, str]]:
    return list(product(KINDS, ENDS))


def exceeded(largest: Largest) -> list[str]:
    return [name for name, (limit, value) in largest.items() if not value <= limit * (1.0 + 1e-6) + 1e-9]


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--updates", type=int, default=100_000, metavar="N", help="in all")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--workers", type=int, default=cpu_count() or 1)
    chosen = parser.parse_args()
    todo = cases()
    kinds, ends = zip(*todo, strict=True)
    count = len(todo)
    broken = False
    sys.stdout.write("| session | end | limit of | limit | largest |\n|---|---|---|---:|---:|\n")
    with ProcessPoolExecutor(chosen.workers) as pool:
        found = pool.map(run, kinds, ends, [chosen.seed] * count, [chosen.updates // count] * count)
        for (kind, end), largest in zip(todo, found, strict=True):
            for name, (limit, value) in largest.items():
                sys.stdout.write(f"| {kind} | {end} | {name} | {limit:.6g} | {value:.6g} |\n")
            for name in exceeded(largest):
                broken = True
                sys.stdout.write(f"BROKEN {kind}, {end}: {name}\n")
    return 1 if broken else 0


if __name__ == "__main__":
    sys.exit(main())
