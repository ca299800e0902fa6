"""What reports a session: it takes the records of both sides and what else is known of them, and judges the session.

The kernel's own is a short summary. Another distribution replaces it by an entry point; the guest `figures` does.
"""

import os
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol, TypedDict

from weberlink.config import Configuration, ConfigurationError
from weberlink.order import COMPLETED, FAILED, INTERRUPTED
from weberlink.protocol.paths import LinkPath
from weberlink.registry import Registry, check_contract

if TYPE_CHECKING:
    from rich.console import Console

    from weberlink.telemetry.reader import Records

SUMMARY = "summary"  # name of the kernel's own report
MEASURED_S = 2.0
"""Time in a session after which the median round trip is that of the link: a process that stalls lengthens it too."""
CHOSEN_BY = "WEBERLINK_REPORT"  # variable of the environment that names the report


class Facts(TypedDict, total=False):
    """What is known of a session beside its records: so far, or at its end; what is by side has the sides that run."""

    outcome: str  # how it ended; "failed: " and the reasons of a run that failed
    faults: Mapping[str, Mapping[str, int]]  # how often each fault began, at the end
    drops: Mapping[str, Mapping[str, int]]  # datagrams that were refused, by reason
    addresses: Mapping[str, str]  # `listen` and `slave` of the file; empty where a path is found
    peers: Mapping[str, Mapping[str, str] | None]  # `weberlink.session.side.PeerFacts`
    paths: Mapping[str, Sequence[LinkPath]]
    dscp: int
    realtime: Mapping[str, Mapping[str, Any] | None]  # rights that the kernel granted or refused
    recording: Mapping[str, Any] | None  # what its recorder says of it; `running` while it runs
    record_age_s: Mapping[str, float]  # of the newest record, while the session runs
    run_time_s: float  # of a run in virtual time
    seed: int  # of the emulated link
    interrupted: bool  # whether Ctrl-C ended a run in virtual time
    status: int  # exit status where it does not depend on how the session went
    traces: Mapping[str, Sequence[str]]  # of an error that ended a side (`traceback.format_exception`)


class Ended(NamedTuple):
    """What is to be told of a session that has ended."""

    status: int  # exit status of the command that ran it
    document: dict[str, Any]  # for `--json`; `outcome` and `duration_s` [s] are in every one
    show: Callable[[str, "Console"], None]  # prints the report under a title


class SessionLog(Protocol):
    """The open log of a live session (`--log`)."""

    def trace(self, entries: Sequence[str]) -> None:
        """Write the trace of an error that prevents the session."""


class Report(Protocol):
    """Reports one session; a class of this kind is an entry point of the group `weberlink.reports`.

    Args of the class:
        sides: of a live session those that run here; none of one in virtual time.
        log: what `open_log` gave; None without a log.
    """

    def __init__(self, configuration: Configuration, sides: Sequence[str] = (), log: Any = None) -> None: ...

    @staticmethod
    def open_log(target: Path) -> AbstractContextManager[SessionLog]:
        """Open the log of a session; "-" is standard output. ConfigurationError if it cannot be opened."""

    def add(self, master: "Records", slave: "Records") -> None:
        """Take the next records of both sides, each in order; either may be empty or run ahead."""

    @property
    def round_trip_s(self) -> float | None:
        """Median round trip [s]; None before a side was connected for `MEASURED_S`."""

    def urgent(self, facts: Facts) -> Mapping[str, str]:
        """What a person can remove while the session runs: words by cause. Called about twice a second."""

    def status_line(self, facts: Facts) -> str:
        """A running session in at most 79 characters. Called about ten times a second."""

    def end(self, facts: Facts) -> Ended: ...

    def close(self) -> None:
        """Release what is held, also without an end; may be repeated."""


def _check(name: str, entry: Any) -> None:
    check_contract(f"report {name}", entry, Report)


REPORTS: Registry[type[Report]] = Registry(
    "report", {SUMMARY: "weberlink.session.summary:Summary"}, "weberlink.reports", _check
)


def chosen_report() -> str:
    """Name of what reports: the one of another distribution, the summary without one.

    Raises:
        ConfigurationError: several are installed and the environment names none, or it names one that is not there.
    """
    if asked := os.environ.get(CHOSEN_BY):
        try:
            return REPORTS.check_known(asked)
        except ValueError as error:
            raise ConfigurationError(f"{CHOSEN_BY}: {error}") from None
    others = [name for name in REPORTS if name != SUMMARY]
    if len(others) > 1:
        named = ", ".join(map(REPORTS.owned, others))
        raise ConfigurationError(f"several reports are installed ({named}); name one in {CHOSEN_BY}")
    return others[0] if others else SUMMARY


def report_type(name: str | None = None) -> type[Report]:
    """What reports, or the one of a name; ConfigurationError too if it cannot be imported or used."""
    try:
        return REPORTS[name or chosen_report()]
    except (ImportError, ValueError) as error:
        raise ConfigurationError(str(error)) from None


def exit_status(facts: Facts, *, failed: bool) -> int:
    """That of the command which ran a session."""
    if "status" in facts:
        return facts["status"]
    return FAILED if failed else INTERRUPTED if facts.get("interrupted") else COMPLETED
