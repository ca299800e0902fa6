"""`python -m trials.soak --minutes 60`: soaks, writes JSON; exit status 1 if a law was violated.

Fault after fault, in an order drawn from the seed, and after each the laws. The first round has every kind once; later
rounds combine some with a condition that lasts meanwhile.
"""

import argparse
import json
import sys
from collections.abc import Collection
from contextlib import ExitStack, nullcontext, suppress
from pathlib import Path
from random import Random
from signal import SIG_IGN, SIGHUP, SIGINT, SIGTERM, Signals, signal
from time import monotonic
from types import FrameType

from trials.rig import SILENCE_MS, Session
from trials.soak import laws
from trials.soak.faults import CONDITIONS, EXCLUDED, FAULTS, Fault, Field
from trials.soak.report import Kind, Report
from trials.soak.watch import SoakError, Watch
from weberlink.protocol.emulation import Emulation
from weberlink_figures.environment import environment, footer

QUIET_S, LONG_QUIET_S = 0.5, 4.0  # after a fault, before the session is judged, and for how long
SETTLE_S = 0.5
LAST_HOPE_S = 60.0  # after which a session that has not come back is not waited for
RARE_EVERY = 3
TOGETHER = 0.4
SHORT_MINUTES = 3.0
MOST_VIOLATIONS = 50
STALL_SHARE = 0.5
ALONE_S = 0.15  # beyond the limit, one side may be in a session alone: how late a shared machine may be [s]
STOP_SIGNALS = (SIGHUP, SIGINT, SIGTERM)


class Soak:
    def __init__(self, minutes: float, seed: int, faults: Collection[str]) -> None:
        self._random = Random(seed)
        self._is_short = minutes <= SHORT_MINUTES
        self._faults = {name: FAULTS[name] for name in faults}
        self.report = Report(seed, minutes)

    def run(self, silence_ms: float = SILENCE_MS) -> Report:
        """Soak; whatever ends it, the report is what was seen until then."""
        report, until = self.report, monotonic() + self.report.minutes * 60.0
        with ExitStack() as stack:
            rig = stack.enter_context(Session(seed=report.seed, silence_ms=silence_ms))
            watch = Watch(rig, self._say)
            if not watch.until(watch.engaged, LAST_HOPE_S):
                report.violations.append(f"no session within {LAST_HOPE_S:g} s of the start")
                return report
            watch.wait(LONG_QUIET_S / 2)
            report.violations += watch.rest()
            try:
                field = Field(rig, watch, self._random, self._is_short)
                while len(report.failures()) < MOST_VIOLATIONS and not (
                    set(report.kinds) >= set(self._faults) and (self._is_short or monotonic() >= until)
                ):
                    self._round(field, until)
                    report.rounds += 1
                report.summaries = rig.stop()
                for side, told in report.summaries.items():
                    if told.get("outcome") != "terminated" or rig.sides[side].status:
                        self._say(f"the {side} did not end in order: {rig.sides[side].outcome}")
            finally:
                report.ticks, report.longest_queue_bytes = watch.ticks, watch.longest_queue
                if watch.overruns:
                    text = f"{watch.overruns} records were overwritten before the soak could read them"
                    report.violations.append(text)
                report.measure(list(watch.lives.values()))
        return report

    def _round(self, field: Field, until: float) -> None:
        is_first, has_rare = not self.report.rounds, self.report.rounds % RARE_EVERY == 0
        names = [name for name, fault in self._faults.items() if has_rare or not fault.rare]
        self._random.shuffle(names)
        for name in names:
            if not is_first and monotonic() >= until:
                return
            under = ""
            if not is_first and self._random.random() < TOGETHER:
                under = self._random.choice([other for other in CONDITIONS if name not in EXCLUDED[other]])
            left, failures = max(0.0, until - monotonic()), len(self.report.failures())
            write(f"{left:5.0f} s left, {failures} violations; now: {name}{f' under {under}' * bool(under)}\n")
            self._apply(name, self._faults[name], under, field)

    def _apply(self, name: str, fault: Fault, under: str, field: Field) -> None:
        kind, watch, silence = self.report.kinds.setdefault(name, Kind()), field.watch, field.rig.silence
        kind.count += 1
        kind.together += bool(under)
        field.notes, field.ended_at = {}, None
        with CONDITIONS[under](field) if under else nullcontext():
            watch.wait(SETTLE_S if under else 0.0)
            watch.begin()
            found = fault.inject(field)
            field.rig.wire.emulate(Emulation())
            ended = field.ended_at or monotonic()
            is_stalled = watch.stall() > STALL_SHARE * silence
            if fault.keeps and not is_stalled:
                found += laws.stays(watch.both())
            kind.stalls += fault.keeps and is_stalled
            found += laws.engaged_alone(watch.both(), field.rig.limit + ALONE_S)
            if watch.until(lambda: watch.engaged(max(ended, monotonic() - 1.0)), fault.limit_s):
                away = laws.away_for(watch.both(), ended, watch.period)
            else:
                away = fault.limit_s
                found.append(f"no session within {away:g} s after the fault")
            kind.worst_return_s = max(kind.worst_return_s, away)
        if watch.until(lambda: watch.engaged(ended), LAST_HOPE_S):
            found += self._rest(field)
        for note, count in field.notes.items():
            kind.notes[note] = kind.notes.get(note, 0) + count
        kind.violations += found

    def _rest(self, field: Field) -> list[str]:
        """A quiet moment: the session stays, and nothing has piled up."""
        watch = field.watch
        watch.wait(QUIET_S)
        watch.begin()
        watch.wait(QUIET_S if self._is_short else self._random.uniform(1.0, LONG_QUIET_S))
        is_stalled = watch.stall() > STALL_SHARE * field.rig.silence
        found = [] if is_stalled else [f"in the quiet afterwards {text}" for text in laws.stays(watch.both())]
        return found + watch.rest()

    def _say(self, text: str) -> None:
        if len(self.report.violations) < MOST_VIOLATIONS:
            self.report.violations.append(text)


def write(text: str) -> None:
    """To a terminal that may have gone away meanwhile."""
    with suppress(OSError):
        sys.stdout.write(text)
        sys.stdout.flush()


def stop(number: int, _frame: FrameType | None) -> None:
    for each in STOP_SIGNALS:  # tidying up takes a moment, and is not to be broken off
        signal(each, SIG_IGN)
    raise SoakError(f"ended early by {Signals(number).name}")


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument(
        "--minutes", type=float, default=60.0, help="3 or less: every fault once, and as short as can be"
    )
    parser.add_argument("--faults", nargs="+", choices=[*FAULTS], default=[*FAULTS], metavar="KIND", help="only these")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--silence-ms", type=float, default=SILENCE_MS, help="limit of silence of the session")
    parser.add_argument("--json", type=Path, metavar="OUT")
    arguments = parser.parse_args()
    for number in STOP_SIGNALS:
        signal(number, stop)
    soak, began = Soak(arguments.minutes, arguments.seed, arguments.faults), monotonic()
    try:
        soak.run(arguments.silence_ms)
    except SoakError as error:
        soak.report.violations.append(str(error))
    facts = environment()
    lines = [*soak.report.lines(), f"{monotonic() - began:.0f} s; {footer(facts, arguments.seed)}"]
    write("\n" + "\n".join(lines) + "\n")
    if arguments.json is not None:
        told = soak.report.to_dict() | {"environment": facts}
        arguments.json.write_text(json.dumps(told, indent=1, default=float), encoding="utf-8")
    return 1 if soak.report.failures() else 0


if __name__ == "__main__":
    sys.exit(main())
