"""The soak: fault after fault, in an order drawn from the seed, and after each the laws.

The first round has every kind once; later rounds combine some with a condition that lasts meanwhile.
"""

from collections.abc import Callable, Collection
from contextlib import nullcontext
from random import Random
from time import monotonic

from tests.soak import laws
from tests.soak.conditions import CONDITIONS, EXCLUDED, Field
from tests.soak.faults import FAULTS, Fault
from tests.soak.report import Kind, Report
from tests.soak.rig import SILENCE_MS, Rig
from tests.soak.watch import Watch
from weberlink.protocol.emulation import Emulation
from weberlink.system.configuration import SIDES

QUIET_S = 0.5
"""After a fault, before the session is judged."""
LONG_QUIET_S = 4.0
SETTLE_S = 0.5
LAST_HOPE_S = 60.0
"""After which a session that has not come back is not waited for."""
RARE_EVERY = 3
TOGETHER = 0.4
SHORT_MINUTES = 3.0
MOST_VIOLATIONS = 50
_STALL_SHARE = 0.5
ALONE_S = 0.15
"""Beyond the silence limit, one side may be in a session alone: how late a shared machine may be [s]."""

Tell = Callable[[Report, str, float], None]


class Soak:
    """One run.

    Args:
        minutes: how long; every kind of fault is seen once in any case.
        seed: of the order, the durations and the relay.
        tell: called with the report, the fault that begins and the seconds that are left.
        silence_ms: limit of silence of the session.
        faults: names of the kinds, of `FAULTS`.
    """

    def __init__(
        self,
        minutes: float,
        seed: int,
        tell: Tell,
        silence_ms: float = SILENCE_MS,
        faults: Collection[str] = tuple(FAULTS),
    ) -> None:
        self._random = Random(seed)
        self._tell = tell
        self._short = minutes <= SHORT_MINUTES
        self._silence_ms = silence_ms
        self._faults = {name: FAULTS[name] for name in faults}
        self.report = Report(seed, minutes)

    def run(self) -> Report:
        """Soak; whatever ends it, the report is what was seen until then.

        Raises:
            RigError: a daemon has ended by itself, or there was no session to begin with.
        """
        report = self.report
        until = monotonic() + report.minutes * 60.0
        with Rig(seed=report.seed, steps=True, silence_ms=self._silence_ms) as rig:
            self._watch = watch = Watch(rig, self._say)
            watch.extra["relay"] = rig.wire.pid
            if not watch.until(watch.engaged, LAST_HOPE_S):
                report.violations.append(f"no session within {LAST_HOPE_S:g} s of the start")
                return report
            watch.wait(LONG_QUIET_S / 2)
            report.violations += watch.rest()
            try:
                while not self._is_over(until):
                    self._round(Field(rig, watch, self._random, self._short), until)
                    report.rounds += 1
                report.summaries = rig.stop()
                self._judge_end()
            finally:
                self._sum_up(watch, rig)
        return report

    def _is_over(self, until: float) -> bool:
        if len(self.report.failures()) >= MOST_VIOLATIONS:
            return True
        has_seen_all = set(self.report.kinds) >= set(self._faults)
        return has_seen_all and (self._short or monotonic() >= until)

    def _round(self, field: Field, until: float) -> None:
        rare = self.report.rounds % RARE_EVERY == 0
        names = [name for name, fault in self._faults.items() if rare or not fault.rare]
        self._random.shuffle(names)
        for name in names:
            if self.report.rounds and monotonic() >= until:
                return
            under = ""
            if self.report.rounds and self._random.random() < TOGETHER:
                under = self._random.choice([other for other in CONDITIONS if name not in EXCLUDED[other]])
            self._tell(self.report, name + (f" under {under}" if under else ""), until - monotonic())
            self._apply(name, self._faults[name], under, field)

    def _apply(self, name: str, fault: Fault, under: str, field: Field) -> None:
        """One fault, the way back, and the laws."""
        kind, watch = self.report.kind(name), field.watch
        kind.count += 1
        kind.together += bool(under)
        field.notes.clear()
        field.ended_at = None
        with CONDITIONS[under](field) if under else nullcontext():
            watch.wait(SETTLE_S if under else 0.0)
            watch.begin()
            found = fault.inject(field)
            field.rig.wire.emulate(Emulation())
            ended = field.ended_at or monotonic()
            stalled = watch.stall() > _STALL_SHARE * field.rig.silence
            if fault.keeps and not stalled:
                found += laws.stays(watch.both())
            kind.stalls += fault.keeps and stalled
            found += laws.engaged_alone(watch.both(), field.rig.silence + ALONE_S)
            found += self._way_back(fault, kind, ended, field)
        if watch.until(lambda: watch.engaged(ended), LAST_HOPE_S):
            found += self._rest(field)
        for note, count in field.notes.items():
            kind.notes[note] = kind.notes.get(note, 0) + count
        kind.violations += found

    def _way_back(self, fault: Fault, kind: Kind, ended: float, field: Field) -> list[str]:
        watch = field.watch
        is_back = watch.until(lambda: watch.engaged(max(ended, monotonic() - 1.0)), fault.limit_s)
        seconds = laws.away_for(watch.both(), ended, 1.0 / field.rig.rate_hz) if is_back else None
        kind.worst_return_s = max(kind.worst_return_s, fault.limit_s if seconds is None else seconds)
        return laws.returned(seconds, fault.limit_s)

    def _rest(self, field: Field) -> list[str]:
        """A quiet moment: the session stays, and nothing has piled up."""
        watch = field.watch
        watch.wait(QUIET_S)
        watch.begin()
        watch.wait(QUIET_S if self._short else self._random.uniform(1.0, LONG_QUIET_S))
        records = watch.both()
        stalled = watch.stall() > _STALL_SHARE * field.rig.silence
        found = [] if stalled else [f"in the quiet afterwards {text}" for text in laws.stays(records)]
        return found + watch.rest()

    def _judge_end(self) -> None:
        for side, summary in self.report.summaries.items():
            if summary["failed"] or summary["status"] != 0:
                self.report.violations.append(f"the {side} did not end in order: {summary['outcome']}")

    def _say(self, text: str) -> None:
        if len(self.report.violations) < MOST_VIOLATIONS:
            self.report.violations.append(text)

    def _sum_up(self, watch: Watch, rig: Rig) -> None:
        report = self.report
        report.ticks, report.overruns = watch.ticks, watch.overruns
        if watch.overruns:
            report.violations.append(f"{watch.overruns} records were overwritten before the soak could read them")
        report.longest_queue_bytes = watch.longest_queue
        books = rig.wire.books()
        report.relay = {"forward": dict(books.forward), "backward": dict(books.backward)}
        report.lives = {side: sum(of.name == side for of in watch.samples.values()) for side in SIDES}
        report.measure(watch.samples.values())
