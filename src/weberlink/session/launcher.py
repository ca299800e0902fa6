"""Start daemons, watch their telemetry and report: the parent process of every live run.

The daemons do not wait for this process; if it dies, they stop in order. What reads and scores records is imported when
there are any: until then the daemons need the processors.
"""

import json
import os
import re
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, ExitStack, nullcontext, suppress
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from signal import SIG_DFL, SIG_IGN, SIGTERM, Signals, getsignal, signal
from subprocess import PIPE
from time import monotonic, sleep, time
from types import FrameType, TracebackType
from typing import TYPE_CHECKING, Any, Self

from weberlink.child_process import Child, python
from weberlink.config import MASTER, SIDES, SLAVE, Configuration
from weberlink.figures.paths import notable, paths_of
from weberlink.figures.verdict import verdict
from weberlink.master.devices import target_link
from weberlink.order import MISCONFIGURED, NOTE, STOP_SIGNALS
from weberlink.protocol.keys import generate
from weberlink.session import control_socket, description
from weberlink.session.composition.channels import lookahead_ms
from weberlink.session.description import DaemonOrder, failure
from weberlink.telemetry.ring import default_path, process_started
from weberlink.telemetry.runtime_directory import directories, directory

if TYPE_CHECKING:
    from weberlink.figures.journal import Journal
    from weberlink.figures.session import Records, SessionScore
    from weberlink.session.host_watch import HostWatch
    from weberlink.telemetry.reader import RingReader
    from weberlink.telemetry.recorders import Recorder

Watch = Callable[[dict[str, Any], dict[str, Any]], None]

LOOK_S = 0.1
"""Time between two looks at the telemetry."""
LEFT_BEHIND = re.compile(r"weberlink-(\d+)(?:-(?:master|slave)\.(?:ring|json|ask)|\.(?:key|pointer|leader|pose))")
LEFT_FOR_S = 3600.0
"""Age at which files without a writer are removed [s]; until then their last records can be read."""
TELL_S = 0.5
"""Time between two looks at what is to be told at once."""
MEASURED_S = 2.0
"""Time in a session after which the median round trip is that of the link: a process that stalls lengthens it too."""
TOLD_AT_ONCE = ("key", "refused", "no_answer", "lost")
"""Causes of a verdict that a person can remove while the session runs; a recording that ends is told with its path."""
STOP_LIMIT_S = 15.0
"""Time from a request to stop to a kill: a robot may be moving to its rest position."""


class Daemon:
    """One child process and its ring."""

    def __init__(self, order: DaemonOrder) -> None:
        self.side = order.side
        self._order = order
        self._reader: RingReader | None = None
        self._ring = Path(order.ring)
        command = python("-m", "weberlink.session.daemon", order.to_json())
        self._process = Child(command, stdout=PIPE, blocked=STOP_SIGNALS)

    @property
    def pid(self) -> int:
        return self._process.pid

    @property
    def running(self) -> bool:
        return self._process.running

    @property
    def begun(self) -> bool:
        """Whether it has created its ring; it has read the file and the key by then."""
        return self._reader is not None or self._ring.exists()

    @property
    def wall_offset_s(self) -> float:
        """Offset from the clock of the records to the wall clock [s]; 0 while there are none."""
        reader = self._reader
        return 0.0 if reader is None else reader.started_wall_s - reader.started_monotonic_s

    def records(self) -> "Records":
        """Records since the last call."""
        import numpy as np  # noqa: PLC0415 - see above

        from weberlink.telemetry.reader import DTYPE, RingReader  # noqa: PLC0415

        if self._reader is None:
            try:
                self._reader = RingReader(self._ring)
            except FileNotFoundError:
                return np.empty(0, DTYPE)
        return self._reader.read()

    @property
    def described(self) -> dict[str, Any] | None:
        """What the side says of itself now, among it of its peer and of its paths."""
        return description.read(self._ring)

    def stop(self, number: Signals) -> None:
        if self.running:
            self._process.send_signal(number)

    def finish(self) -> dict[str, Any]:
        """Wait for the end for a limited time; returns the summary."""
        output = self._process.end(STOP_LIMIT_S)
        try:
            summary: dict[str, Any] = json.loads(output)
        except ValueError:
            summary = failure(f"{self.side} {self._process.how_it_ended}")
        return summary | {"status": self._process.status}

    def release(self) -> None:
        """Close the ring; removes files that a killed daemon left."""
        if self._reader is not None:
            self._reader.close()
        for left in (
            self._ring,
            description.path_beside(self._ring),
            control_socket.path_beside(self._ring),
            *(target_link.link_path(self.pid, kind) for kind in target_link.KINDS),
        ):
            left.unlink(missing_ok=True)


@dataclass
class Session:
    """A live run of one side or both; a context manager that leaves no process behind.

    Args:
        configuration: what to run.
        overrides: as given on the command line; the daemons read the file themselves.
        sides: which daemons to start.
        duration_s: length of the run; None until it is stopped.
        display: opened when the first daemon has created its ring, closed at the end; what it gives is called about ten
            times a second with the newest records and the figures so far, unless it is None.
        record: where to record the session, as MCAP; None to record nothing.
        journal: writes the log; None for no log.
        take_over: whether the master replaces another one that the slave serves.
        tell: receives one line as soon as a cause of failure is there that a person can remove.
        on_delay: gives advice on a measured round trip [s], which is told once; None for none.
    """

    configuration: Configuration
    overrides: Sequence[str]
    sides: Sequence[str] = SIDES
    duration_s: float | None = None
    display: Callable[[], AbstractContextManager[Watch | None]] = nullcontext
    record: Path | None = None
    journal: "Journal | None" = None
    take_over: bool = False
    tell: Callable[[str], None] = lambda _: None
    on_delay: Callable[[float], str | None] = lambda _: None
    daemons: dict[str, Daemon] = field(default_factory=dict)
    _signals: list[Signals] = field(default_factory=list)
    _stack: ExitStack = field(default_factory=ExitStack)
    _recorder: "Recorder | None" = None
    _recording_ended: bool = False
    _begun: bool = False
    _watch: Watch | None = None
    _key: Path | None = None
    _peers: dict[str, Any] = field(default_factory=dict)
    _paths: dict[str, list[dict[str, Any]]] = field(default_factory=dict)
    _told: set[str] = field(default_factory=set)
    _has_advised: bool = False
    _tell_at: float = 0.0

    def __enter__(self) -> Self:
        sweep()
        system = self.configuration.system
        if system.link.security == "session":
            self._make_key()
        for number in STOP_SIGNALS:
            if getsignal(number) is SIG_IGN:  # for example by nohup
                continue
            self._stack.callback(signal, number, signal(number, self._signal) or SIG_DFL)
        rings = {side: _ring(side) for side in self.sides}
        for ring in rings.values():  # left by an earlier process with this process id
            Path(ring).unlink(missing_ok=True)
        if self.record is not None:  # before the daemons, so that it sees their rings appear
            from weberlink.session.recorder import facts, format_for  # noqa: PLC0415

            self._recorder = format_for(self.record).start(facts(self.configuration), rings, self.record)
        for side in sorted(self.sides, reverse=True):  # the slave first: it listens when the master calls
            daemon = Daemon(self._order(side))
            self.daemons[side] = daemon
            self._stack.callback(daemon.release)
        return self

    @cached_property
    def score(self) -> "SessionScore":
        """Figures of the records so far."""
        from weberlink.figures.session import score_of  # noqa: PLC0415

        return score_of(self.configuration.system)

    @cached_property
    def _host(self) -> "HostWatch":
        from weberlink.session.host_watch import HostWatch  # noqa: PLC0415

        system = self.configuration.system
        watch = HostWatch(self.sides, system.realtime, system.tick_period)
        self._stack.callback(watch.stop)
        return watch

    def _make_key(self) -> None:
        """Write a key to memory for both daemons; it is removed when they have read it."""
        self._key = path = directory() / f"weberlink-{os.getpid()}.key"
        path.unlink(missing_ok=True)  # left by an earlier process with this process id
        generate(path)
        self._stack.callback(path.unlink, missing_ok=True)
        self.overrides = [*self.overrides, f"link.key_file={json.dumps(str(path))}"]

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        for daemon in self.daemons.values():
            if daemon.running:
                daemon.stop(SIGTERM)
                daemon.finish()
        if self._recorder is not None:
            self._recorder.finish()  # before the rings are removed
        self._stack.close()

    def run(self) -> dict[str, Any]:
        """Watch until every side has ended; returns the figures of the session."""
        passed_on = 0
        while all(daemon.running for daemon in self.daemons.values()):
            for number in self._signals[passed_on:]:
                self._first.stop(number)
            passed_on = len(self._signals)
            self._look()
            sleep(LOOK_S)
        summaries = {side: self._end(daemon) for side, daemon in self._in_order()}
        self._look()
        recording = {} if self._recorder is None else {"recording": self._recorded(self._recorder)}
        report = self._judged(self._report(summaries) | recording, summaries)
        if self.journal is not None:
            for side, summary in sorted(summaries.items()):
                self.journal.trace(summary.get("trace", ()), side)
            self.journal.end(report)
        return report

    @property
    def _first(self) -> Daemon:
        """The side that ends the run: the master if there is one."""
        return self.daemons.get(MASTER) or self.daemons[SLAVE]

    def _in_order(self) -> list[tuple[str, Daemon]]:
        return sorted(self.daemons.items())

    def _order(self, side: str) -> DaemonOrder:
        return DaemonOrder(
            side=side,
            file=str(self.configuration.path),
            overrides=tuple(self.overrides),
            ring=_ring(side),
            # With both sides, the slave ends when the master has left.
            duration_s=self.duration_s if side == MASTER or len(self.sides) == 1 else None,
            take_over=self.take_over,
        )

    def _end(self, daemon: Daemon) -> dict[str, Any]:
        daemon.stop(SIGTERM)
        return daemon.finish()

    def _look(self) -> None:
        if not self._begun:
            self._begun = any(daemon.begun for daemon in self.daemons.values())
            if not self._begun:
                return
            self._watch = self._stack.enter_context(self.display())
        records = {side: daemon.records() for side, daemon in self.daemons.items()}
        if self._key is not None and all(daemon.begun for daemon in self.daemons.values()):
            self._key.unlink(missing_ok=True)
            self._key = None
        self._host.add(records)
        self._look_at_recorder()
        none = next(iter(records.values()))[:0]
        self.score.add(records.get(MASTER, none), records.get(SLAVE, none))
        if self.journal is not None:
            for side, daemon in self._in_order():
                self.journal.look(side, records[side], daemon.wall_offset_s)
        if monotonic() >= self._tell_at:
            self._tell_at = monotonic() + TELL_S
            self._ask_daemons()
            self._tell()
        if self._watch is not None:
            self._watch(self.score.state, self._figures())

    def _ask_daemons(self) -> None:
        """Take what the sides know of their peers and paths, and log and mark paths that have changed."""
        described = {side: daemon.described or {} for side, daemon in self.daemons.items()}
        self._peers = {side: each.get("peer") for side, each in described.items()}
        for side, each in sorted(described.items()):
            self._take_paths(side, paths_of(each))

    def _take_paths(self, side: str, paths: list[dict[str, Any]]) -> None:
        if not paths:  # a daemon that has ended describes nothing: its last paths stay
            return
        before, self._paths[side] = self._paths.get(side, []), paths
        if self.journal is not None:
            self.journal.take_paths(side, paths)
        if self._recorder is not None:
            for text in notable(before, paths):
                self._recorder.mark(f"{side}: {text}")

    def _figures(self) -> dict[str, Any]:
        """The figures so far, with what telemetry does not contain; `record_age_s` is the age of the newest record."""
        now = monotonic()
        ages = {side: now - float(last["at"]) for side, last in self.score.state.items() if last is not None}
        return self.score.summary() | self._facts(self._peers) | {"record_age_s": ages} | self._recording()

    def _facts(self, peers: dict[str, Any]) -> dict[str, Any]:
        link = self.configuration.system.link
        return {
            # A path that is found has no address of the file.
            "addresses": {} if self.configuration.finds_path else {"listen": link.listen, "slave": link.slave},
            "peers": peers,
            "paths": self._paths,
            "dscp": link.dscp,
        }

    def _recording(self) -> dict[str, Any]:
        """The state of the recorder, if there is one; its own summary once it has ended."""
        if self._recorder is None:
            return {}
        return {"recording": {"running": True} if self._recorder.running else self._recorder.finish()}

    def _tell(self) -> None:
        """Print what cannot wait for the end: causes, again if they went and returned; once, advice on the delay."""
        figures = self._figures()
        causes = {cause.name: cause for cause in verdict(figures).causes if cause.name in TOLD_AT_ONCE}
        for name in causes.keys() - self._told:
            self.tell(causes[name].text)
        self._told = set(causes)
        median_us, sides = figures["link"]["rtt_us"]["p50"], figures["connection"].values()
        is_measured = median_us is not None and any(side and side["connected_s"] >= MEASURED_S for side in sides)
        if is_measured and not self._has_advised and (advice := self.on_delay(1e-6 * median_us)) is not None:
            self._has_advised = True
            self.tell(f"{NOTE}{advice}")

    def _look_at_recorder(self) -> None:
        """Say once, at once, that the recorder ended before the daemons."""
        recorder = self._recorder
        early = recorder is not None and not recorder.running and all(each.running for each in self.daemons.values())
        if recorder is not None and early and not self._recording_ended:
            from weberlink.session.recorder import recording_ended  # noqa: PLC0415 - see above

            self._recording_ended = True
            self.tell(recording_ended(recorder.path, recorder.finish()["outcome"]))

    def _recorded(self, recorder: "Recorder") -> dict[str, Any]:
        """The summary of the recorder; says that the recording failed, unless that was said at once."""
        from weberlink.session.recorder import failure  # noqa: PLC0415 - see above

        if not self._recording_ended and (why := failure(recorder)) is not None:
            self.tell(why)
        return recorder.finish()

    def _report(self, summaries: dict[str, dict[str, Any]]) -> dict[str, Any]:
        failures = [summary["outcome"] for summary in summaries.values() if summary["failed"]]
        asked = summaries[self._first.side]["outcome"]
        peers = {side: summary["peer"] for side, summary in summaries.items()}
        for side, summary in sorted(summaries.items()):
            self._take_paths(side, paths_of(summary))
        return (
            self.score.summary()
            | {"ways": self.score.ways()}
            | self._facts(peers)
            | {
                "lookahead_ms": lookahead_ms(self.configuration.system),
                "playout_ms": self.configuration.system.link.playout_ms,
                "faults": {side: summary["faults"] for side, summary in summaries.items()},
                "drops": {side: summary["drops"] for side, summary in summaries.items()},
                "realtime": {side: summary["realtime"] for side, summary in summaries.items()},
                "host": self._host.end(),
                "outcome": f"failed: {'; '.join(failures)}" if failures else asked,
            }
        )

    def _judged(self, report: dict[str, Any], summaries: dict[str, dict[str, Any]]) -> dict[str, Any]:
        """The report with its verdict and exit status: that of a wrong file if a daemon reported one."""
        judged = verdict(report)
        is_wrong_file = any(summary["status"] == MISCONFIGURED for summary in summaries.values())
        return report | {"verdict": judged.document(), "status": MISCONFIGURED if is_wrong_file else judged.status}

    def _signal(self, number: int, _frame: FrameType | None) -> None:
        self._signals.append(Signals(number))


def sweep(folders: Sequence[Path] | None = None) -> None:
    """Remove old files in shared memory that killed launchers and daemons of this user left.

    Args:
        folders: where to look; None for the runtime directories of this user.
    """
    for path in (path for folder in (directories() if folders is None else folders) for path in folder.iterdir()):
        found = LEFT_BEHIND.fullmatch(path.name)
        with suppress(OSError):  # gone by now
            if found and time() - path.lstat().st_mtime > LEFT_FOR_S and process_started(int(found[1])) is None:
                path.unlink()


def _ring(side: str) -> str:
    return str(default_path(f"{os.getpid()}-{side}"))
