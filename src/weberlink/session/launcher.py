"""Start daemons, watch their telemetry and report: the parent process of every live run.

The daemons do not wait for this process; if it dies, they stop in order. What reads and scores records is imported when
there are any: until then the daemons need the processors.
"""

import json
import os
import re
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack, nullcontext, suppress
from dataclasses import dataclass, field
from functools import cached_property, partial
from pathlib import Path
from signal import SIG_DFL, SIG_IGN, SIGTERM, Signals, getsignal, signal
from time import monotonic, sleep, time
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self

from weberlink.child_process import Child, python
from weberlink.config import MASTER, SIDES, SLAVE, Configuration, cameras
from weberlink.order import MISCONFIGURED, NOTE, STOP_SIGNALS
from weberlink.protocol.keys import generate
from weberlink.protocol.paths import LinkPath, notable, paths_of
from weberlink.session import control_socket, description
from weberlink.session.description import DaemonOrder, failure
from weberlink.session.report import Facts, Report, report_type
from weberlink.session.waiting import WaitingDaemon
from weberlink.telemetry.ring import default_path, process_started
from weberlink.telemetry.runtime_directory import directories, directory

if TYPE_CHECKING:
    from weberlink.session.report import Ended
    from weberlink.telemetry.reader import Records, RingReader
    from weberlink.telemetry.recorders import Recorder

Watch = Callable[[str], None]

LOOK_S = 0.1  # time between two looks at the telemetry
LEFT_BEHIND = re.compile(r"weberlink-(\d+)[-.].+")
LEFT_FOR_S = 3600.0
"""Age at which files without a writer are removed [s]; until then their last records can be read."""
CAMERAS_END_S = 1.0  # for the process of the pictures to end after SIGTERM [s]
TELL_S = 0.5  # time between two looks at what is to be told at once
STOP_LIMIT_S = 15.0  # time from a request to stop to a kill: a robot may be moving to its rest position


class Daemon:
    def __init__(self, order: DaemonOrder, waiting: WaitingDaemon) -> None:
        self.side = order.side
        self._reader: RingReader | None = None
        self.ring = Path(order.ring)
        self.newest_at: float | None = None  # deadline of the newest record [s]
        with control_socket.reserved(order.ring) as (listener, self._held):
            self._process = waiting.begin(order.to_json(), listener.fileno())
        self.pid = self._process.pid

    @property
    def running(self) -> bool:
        return self._process.running

    @property
    def begun(self) -> bool:
        """Whether it has created its ring; it has read the file and the key by then."""
        return self._reader is not None or self.ring.exists()

    def records(self) -> "Records":
        import numpy as np  # noqa: PLC0415 - see above

        from weberlink.telemetry.reader import DTYPE, RingReader  # noqa: PLC0415

        if self._reader is None:
            try:
                self._reader = RingReader(self.ring)
            except FileNotFoundError:
                return np.empty(0, DTYPE)
        records = self._reader.read()
        if len(records):
            self.newest_at = float(records["at"][-1])
        return records

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
        """Close the ring and the control socket; removes files that a killed daemon left."""
        os.close(self._held)
        if self._reader is not None:
            self._reader.close()
        for of_daemon in (f"{self.ring.stem}.*", f"weberlink-{self.pid}.*"):  # its own, and those of its drivers
            for left in self.ring.parent.glob(of_daemon):
                left.unlink(missing_ok=True)


@dataclass
class LiveRun:
    """A live run of one side or both; a context manager that leaves no process behind."""

    configuration: Configuration
    overrides: Sequence[str]  # as given on the command line; the daemons read the file themselves
    sides: Sequence[str] = SIDES
    duration_s: float | None = None  # length of the run; None until it is stopped
    # Opened when the first daemon has created its ring, closed at the end; what it gives is called about ten times a
    # second with the status line, unless it is None
    display: Callable[[], AbstractContextManager[Watch | None]] = nullcontext
    record: Path | None = None  # where to record the session, as MCAP; None to record nothing
    # Makes the report when the first daemon has created its ring; None for the one that is installed
    make_report: Callable[[], Report] | None = None
    take_over: bool = False  # whether the master replaces another one that the slave serves
    # Receives one line as soon as a cause of failure is there that a person can remove
    tell: Callable[[str], None] = lambda _: None
    # Gives advice on a measured round trip [s], which is told once; None for none
    on_delay: Callable[[float], str | None] = lambda _: None
    waiting: Mapping[str, WaitingDaemon] = field(default_factory=dict)  # those that were started before, by side
    daemons: dict[str, Daemon] = field(default_factory=dict)
    # Processes of pictures, by the socket that each serves once it has read its key.
    _cameras: dict[Path, Child] = field(default_factory=dict)
    _signals: list[Signals] = field(default_factory=list)
    _stack: ExitStack = field(default_factory=ExitStack)
    _recorder: "Recorder | None" = None
    _recording_ended: bool = False
    _begun: bool = False
    _watch: Watch | None = None
    _key: Path | None = None
    _peers: dict[str, Any] = field(default_factory=dict)
    _paths: dict[str, list[LinkPath]] = field(default_factory=dict)
    _told: set[str] = field(default_factory=set)
    _tell_at: float = 0.0

    def __enter__(self) -> Self:
        sweep()
        if self.configuration.system.link.security == "session":
            # A key in memory for both daemons; it is removed when they have read it.
            self._key = path = directory() / f"weberlink-{os.getpid()}.key"
            path.unlink(missing_ok=True)  # left by an earlier process with this process id
            generate(path)
            self._stack.callback(path.unlink, missing_ok=True)
            self.overrides = [*self.overrides, f"link.key_file={json.dumps(str(path))}"]
        for number in STOP_SIGNALS:
            if getsignal(number) is SIG_IGN:  # for example by nohup
                continue
            before = signal(number, lambda number, _: self._signals.append(Signals(number)))
            self._stack.callback(signal, number, before or SIG_DFL)
        rings = {side: default_path(f"{os.getpid()}-{side}") for side in self.sides}
        for ring in rings.values():  # left by an earlier process with this process id
            ring.unlink(missing_ok=True)
        if self.record is not None:  # before the daemons, so that it sees their rings appear
            from weberlink.session.recorder import described, format_for  # noqa: PLC0415

            by_side = {side: str(ring) for side, ring in rings.items()}
            self._recorder = format_for(self.record).start(described(self.configuration), by_side, self.record)
        self._start_cameras(rings)
        for side in sorted(self.sides, reverse=True):  # the slave first: it listens when the master calls
            order = DaemonOrder(
                side=side,
                file=str(self.configuration.path),
                overrides=tuple(self.overrides),
                ring=str(rings[side]),
                # With both sides, the slave ends when the master has left.
                duration_s=self.duration_s if side == MASTER or len(self.sides) == 1 else None,
                take_over=self.take_over,
            )
            waiting = self.waiting.get(side) or self._stack.enter_context(WaitingDaemon(side))
            daemon = self.daemons[side] = Daemon(order, waiting)
            self._stack.callback(daemon.release)
        return self

    def _start_cameras(self, rings: Mapping[str, Path]) -> None:
        """Start what makes or receives the pictures of the file: with both sides, that of the slave alone."""
        part = self.configuration.cameras
        side = SLAVE if SLAVE in rings else MASTER
        if part is not None:
            order = cameras.PicturesOrder(
                side, str(self.configuration.path), tuple(self.overrides), str(rings[side]), len(rings) == 1
            )
            child = Child(python("-m", part.driver.MODULE, order.to_json()))
            self._cameras[cameras.path_beside(rings[side])] = child
            self._stack.callback(child.end, CAMERAS_END_S)
            self._stack.callback(child.send_signal, SIGTERM)

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        for daemon in self.daemons.values():
            if daemon.running:
                daemon.stop(SIGTERM)
                daemon.finish()
        if self._recorder is not None:
            self._recorder.finish()  # before the rings are removed
        self._stack.close()

    @cached_property
    def _report(self) -> Report:
        make = self.make_report or partial(report_type(), self.configuration, self.sides)
        report = make()
        self._stack.callback(report.close)
        return report

    def run(self) -> "Ended":
        """Watch until every side has ended; returns what is to be told of the session."""
        first = self.daemons.get(MASTER) or self.daemons[SLAVE]  # the side that ends the run
        passed_on = 0
        while all(daemon.running for daemon in self.daemons.values()):
            for number in self._signals[passed_on:]:
                first.stop(number)
            passed_on = len(self._signals)
            self._look()
            sleep(LOOK_S)
        summaries = {}
        for side, daemon in sorted(self.daemons.items()):
            daemon.stop(SIGTERM)
            summaries[side] = daemon.finish()
        self._look()
        if self._recorder is not None and not self._recording_ended:
            from weberlink.session.recorder import failure  # noqa: PLC0415 - see above

            if (why := failure(self._recorder)) is not None:
                self.tell(why)
        for side, summary in summaries.items():
            self._add_paths(side, paths_of(summary))
        self._peers = {side: summary["peer"] for side, summary in summaries.items()}
        failures = [summary["outcome"] for summary in summaries.values() if summary["failed"]]
        facts = self._facts()
        del facts["record_age_s"]
        facts |= {
            "faults": {side: summary["faults"] for side, summary in summaries.items()},
            "drops": {side: summary["drops"] for side, summary in summaries.items()},
            "realtime": {side: summary["realtime"] for side, summary in summaries.items()},
            "outcome": f"failed: {'; '.join(failures)}" if failures else summaries[first.side]["outcome"],
            "traces": {side: summary.get("trace", ()) for side, summary in summaries.items()},
        }
        if any(summary["status"] == MISCONFIGURED for summary in summaries.values()):
            facts["status"] = MISCONFIGURED
        return self._report.end(facts)

    def _look(self) -> None:
        if not self._begun:
            if not any(daemon.begun for daemon in self.daemons.values()):
                return
            self._begun = True
            self._watch = self._stack.enter_context(self.display())
        records = {side: daemon.records() for side, daemon in self.daemons.items()}
        self._tell_what_ended()
        has_key = (path.exists() for path in self._cameras)
        if self._key is not None and all((*has_key, *(daemon.begun for daemon in self.daemons.values()))):
            self._key.unlink(missing_ok=True)
            self._key = None
        none = next(iter(records.values()))[:0]
        self._report.add(records.get(MASTER, none), records.get(SLAVE, none))
        if monotonic() >= self._tell_at:
            self._tell_at = monotonic() + TELL_S
            described = {side: description.read(each.ring) or {} for side, each in sorted(self.daemons.items())}
            self._peers = {side: each.get("peer") for side, each in described.items()}
            for side, each in described.items():
                self._add_paths(side, paths_of(each))
            self._tell()
        if self._watch is not None:
            self._watch(self._report.status_line(self._facts()))

    def _tell_what_ended(self) -> None:
        """Say once, at once, that the pictures or the recorder ended before the daemons; the session goes on."""
        for path, child in list(self._cameras.items()):
            if not child.running:
                del self._cameras[path]
                self.tell(f"no more pictures: their process {child.how_it_ended}")
        recorder = self._recorder
        if recorder is None or recorder.running or self._recording_ended:
            return
        if all(daemon.running for daemon in self.daemons.values()):
            from weberlink.session.recorder import recording_ended  # noqa: PLC0415 - see above

            self._recording_ended = True
            self.tell(recording_ended(recorder.path, recorder.finish()["outcome"]))

    def _add_paths(self, side: str, paths: list[LinkPath]) -> None:
        """Mark paths that have changed."""
        if not paths:  # a daemon that has ended describes nothing: its last paths stay
            return
        before, self._paths[side] = self._paths.get(side, []), paths
        if self._recorder is not None:
            for text in notable(before, paths):
                self._recorder.mark(f"{side}: {text}")

    def _facts(self) -> Facts:
        """What is known so far beside the records."""
        now, link, recorder = monotonic(), self.configuration.system.link, self._recorder
        newest = {side: daemon.newest_at for side, daemon in self.daemons.items()}
        return Facts(
            # A path that is found has no address of the file.
            addresses={} if self.configuration.finds_path else {"listen": link.listen, "slave": link.slave},
            peers=self._peers,
            paths=self._paths,
            dscp=link.dscp,
            record_age_s={side: now - at for side, at in newest.items() if at is not None},
            recording=None if recorder is None else {"running": True} if recorder.running else recorder.finish(),
        )

    def _tell(self) -> None:
        """Print what cannot wait for the end: causes, again if they went and returned; once, advice on the delay."""
        causes = self._report.urgent(self._facts())
        for name in causes.keys() - self._told:
            self.tell(causes[name])
        self._told = set(causes)
        round_trip_s = self._report.round_trip_s
        if round_trip_s is not None and (advice := self.on_delay(round_trip_s)) is not None:
            self.on_delay = lambda _: None
            self.tell(f"{NOTE}{advice}")


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
