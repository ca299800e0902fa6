"""Reports a session with all its figures, live or in virtual time."""

from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import replace
from pathlib import Path
from time import monotonic, time
from typing import TYPE_CHECKING, Any

from weberlink.config import MASTER, SLAVE, Configuration, System
from weberlink.order import COMPLETED
from weberlink.session.composition.channels import streams
from weberlink.session.report import Ended, Facts, exit_status
from weberlink.telemetry.reader import Records
from weberlink_figures.environment import environment
from weberlink_figures.host_watch import HostWatch
from weberlink_figures.journal import Journal
from weberlink_figures.log_file import LogFile
from weberlink_figures.report import session_report, status_line
from weberlink_figures.session import score_of
from weberlink_figures.tree import FAILURE, Figures
from weberlink_figures.verdict import verdict

if TYPE_CHECKING:
    from rich.console import Console

    from weberlink.session.simulation import Observer


class FiguresReport:
    """A `weberlink.session.report.Report`; `score` has the figures so far, `ended` those at the end."""

    def __init__(self, configuration: Configuration, sides: Sequence[str] = (), log: LogFile | None = None) -> None:
        system = configuration.system
        self.score = score_of(system)
        self.ended: Figures | None = None
        self._sides = sorted(sides)
        self._settings: dict[str, Any] = {"lookahead_ms": lookahead_ms(system), "playout_ms": system.link.playout_ms}
        self._host = HostWatch(sides, system.realtime, system.tick_period) if sides else None
        self._journal = None if log is None else Journal(log.write_json, system.rate_hz)
        self._wall_offset_s = time() - monotonic()

    @staticmethod
    def open_log(target: Path) -> AbstractContextManager[LogFile]:
        return LogFile(target)

    def add(self, master: Records, slave: Records) -> None:
        by_side = {MASTER: master, SLAVE: slave}
        if self._host is not None:
            self._host.add({side: by_side[side] for side in self._sides})
        self.score.add(master, slave)
        if self._journal is not None:
            for side in self._sides:
                self._journal.add(side, by_side[side], self._wall_offset_s)

    def close(self) -> None:
        if self._host is not None:
            self._host.stop()

    @property
    def round_trip_s(self) -> float | None:
        return self.score.round_trip_s

    def urgent(self, facts: Facts) -> Mapping[str, str]:
        self._log(facts)
        return self.score.urgent(facts)

    def status_line(self, facts: Facts) -> str:
        return status_line(self.score.state, self._figures(facts))

    def end(self, facts: Facts) -> Ended:
        figures = replace(self._figures(facts), **self._settings)
        if self._host is not None:
            figures = replace(figures, host=self._host.end())
        judged = verdict(figures)
        status = exit_status(facts, failed=judged.word == FAILURE)
        self.ended = figures = replace(figures, verdict=judged, status=status)
        if self._journal is not None:
            self._log(facts)
            for side, entries in facts.get("traces", {}).items():
                self._journal.trace(entries, side)
            self._journal.end(figures)
        return told(figures)

    def _figures(self, facts: Facts) -> Figures:
        """With what telemetry does not contain."""
        known: dict[str, Any] = {name: value for name, value in facts.items() if name != "traces"}
        return replace(self.score.figures(), **known)

    def _log(self, facts: Facts) -> None:
        """Write what is new of peers and paths."""
        if self._journal is not None:
            for side in self._sides:
                self._journal.add_paths(side, facts.get("paths", {}).get(side, ()))
                self._journal.add_peer(side, facts.get("peers", {}).get(side))


def told(figures: Figures) -> Ended:
    """What is told of a session that has ended, by its figures."""
    found = environment()

    def show(title: str, console: "Console") -> None:
        session_report(figures, title, console, found)

    return Ended(figures.status or COMPLETED, replace(figures, status=None).to_json() | {"environment": found}, show)


def simulated(configuration: Configuration, duration_s: float | None = None, *observers: "Observer") -> Figures:
    """The figures of a session in virtual time; arguments and errors as of `weberlink.simulate`."""
    from weberlink.session.simulation import simulate  # noqa: PLC0415 - a live session needs none of it

    report = FiguresReport(configuration)
    report.end(simulate(configuration, duration_s, [report.add, *observers]))
    assert report.ended is not None
    return report.ended


def lookahead_ms(system: System) -> dict[str, float]:
    """How much later than without look-ahead the signals are displayed, by channel, in whole ticks; none of an arm."""
    if system.codec.joints is not None:
        return {}
    (position, *_), (force, *_) = streams(system)
    return {
        "position": 1e3 * position.lookahead * system.tick_period,
        "force": 1e3 * force.lookahead * system.tick_period,
    }
