"""The kernel's own report of a session: how it ended, updates by stream, loss, round trip, missed ticks and faults."""

from collections import deque
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from dataclasses import replace
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, TypeVar

import numpy as np

from weberlink.compiled import build, is_compiled
from weberlink.config import MASTER, SIDES, SLAVE, Configuration, ConfigurationError, System
from weberlink.installation import absence, install_line
from weberlink.protocol.states import State
from weberlink.session.ending import URGENT, Connection, failures
from weberlink.session.report import CHOSEN_BY, MEASURED_S, REPORTS, SUMMARY, Ended, Facts, SessionLog, exit_status
from weberlink.telemetry.fault import Fault, name_of
from weberlink.telemetry.reader import Records
from weberlink.telemetry.record import SECOND

if TYPE_CHECKING:
    from rich.console import Console

PIECES = 600  # of records, whose median round trips are kept
TOLD = ("outcome", "drops", "peers", "realtime", "recording", "run_time_s", "seed", "interrupted")
"""Facts that the document has as they are."""


def streams(system: System) -> dict[str, tuple[str, ...]]:
    """Names of the streams of each side, first and second."""
    codec = system.codec
    if codec.joints is None:
        names, more = {SLAVE: ("force", "torque"), MASTER: ("position", "orientation")}, codec.rotation is not None
    else:
        names = {SLAVE: ("joint_torque", "gripper_torque"), MASTER: ("joint_angle", "gripper_angle")}
        more = codec.gripper is not None
    return {side: each[: 1 + more] for side, each in names.items()}


class SideCounts:
    """What is counted of the records of one side."""

    def __init__(self) -> None:
        self.ticks = self.engaged = 0
        self.last: Any = None
        self.connection = Connection()
        self.faults: dict[str, int] = {}  # how often each began
        self.round_trips_us: deque[float] = deque(maxlen=PIECES)

    def add(self, records: Records) -> None:
        """Take the next records, one or more."""
        engaged = records["state"] == State.ENGAGED.value
        self.ticks += len(records)
        self.engaged += int(engaged.sum())
        self.connection.add(records)
        begun = np.diff(records["fault"], prepend=np.uint8(self.counter("fault"))) != 0
        for number in records["fault"][begun & (records["fault"] > 0)].tolist():
            name = name_of(Fault, number)
            self.faults[name] = self.faults.get(name, 0) + 1
        measured = records["rtt_us"][engaged]
        if len(measured := measured[np.isfinite(measured)]):
            self.round_trips_us.append(float(np.median(measured)))
        self.last = records[-1]

    def counter(self, name: str) -> int:
        """The last value of a cumulative field."""
        return 0 if self.last is None else int(self.last[name])


Counts = TypeVar("Counts", bound=SideCounts)


class SessionCounts(Generic[Counts]):
    """The sides of a session, on one clock; `make` makes what counts one."""

    def __init__(self, tick_period: float, make: Callable[[], Counts]) -> None:
        self.tick_period = tick_period
        self.sides = {side: make() for side in SIDES}
        self._first, self._until = inf, 0.0

    def add(self, master: Records, slave: Records) -> None:
        """Take the next records of both sides, each in order of time; either may be empty or run ahead."""
        for side, records in zip(SIDES, (master, slave), strict=True):
            if len(records):
                self.sides[side].add(records)
                self._first = min(self._first, float(records["at"][0]))
                self._until = max(self._until, float(records["at"][-1]))

    @property
    def duration_s(self) -> float:
        return self._until - self._first + self.tick_period if self._first < inf else 0.0

    @property
    def faults(self) -> dict[str, dict[str, int]]:
        """How often each fault began, by side that has records and name."""
        return {name: side.faults for name, side in self.sides.items() if side.ticks}

    @property
    def connections(self) -> dict[str, Connection | None]:
        """How long each side was connected; None of one without records."""
        return {name: replace(side.connection) if side.ticks else None for name, side in self.sides.items()}

    @property
    def round_trip_us(self) -> float | None:
        """Median of the newest, of the master where it runs here."""
        found = next((side.round_trips_us for side in self.sides.values() if side.round_trips_us), None)
        return float(np.median(found)) if found else None

    @property
    def round_trip_s(self) -> float | None:
        """The same; None before a side was connected for `MEASURED_S`."""
        is_measured = any(each is not None and each.connected_s >= MEASURED_S for each in self.connections.values())
        return 1e-6 * self.round_trip_us if is_measured and self.round_trip_us is not None else None

    def failures(self, facts: Facts) -> dict[str, str]:
        """As of `weberlink.session.ending`."""
        return failures({"faults": self.faults, **facts}, self.connections)

    def urgent(self, facts: Facts) -> dict[str, str]:
        """Those of them that a person can remove while the session runs."""
        return {name: text for name, text in self.failures(facts).items() if name in URGENT}


class Summary(SessionCounts[SideCounts]):
    """A `weberlink.session.report.Report`."""

    def __init__(self, configuration: Configuration, sides: Sequence[str] = (), log: Any = None) -> None:  # noqa: ARG002
        super().__init__(configuration.system.tick_period, SideCounts)
        self._system = configuration.system

    @staticmethod
    def open_log(target: Path) -> AbstractContextManager[SessionLog]:  # noqa: ARG004 - writes none
        others = list(REPORTS.absent().values())
        raise ConfigurationError(absence("--log", others[0]) if others else f"--log: {CHOSEN_BY}={SUMMARY} has none")

    def close(self) -> None:
        pass

    def status_line(self, facts: Facts) -> str:
        present = [(name, State(side.counter("state"))) for name, side in self.sides.items() if side.ticks]
        states = [f"{name} {state.name.lower()}" for name, state in present]
        parts = [f"{self.duration_s:6.1f} s", "; ".join(states) or "starting"]
        recording = facts.get("recording")
        if recording is not None and not recording.get("running", False):
            parts.insert(1, "NOT RECORDING")
        if self.round_trip_us is not None:
            parts.append(f"rtt {1e-3 * self.round_trip_us:.2f} ms")
        return "  ".join(parts)[:79]

    def end(self, facts: Facts) -> Ended:
        failed, packets = self.failures(facts), self._packets()
        word = "failed" if failed else "ended"
        sides = self.sides.items()
        ticks = {name: {"count": side.ticks, "missed": side.counter("ticks_missed")} for name, side in sides}
        names = ("sent", "received", "lost", "dropped")
        link = {name: sum(side.counter(f"datagrams_{name}") for _, side in sides) for name in names}
        faults = facts.get("faults", {})
        causes = [{"level": "failed", "name": name, "text": text} for name, text in failed.items()]
        document = {
            "duration_s": self.duration_s,
            "ticks": ticks,
            **packets,
            "link": {"rtt_us": {"p50": self.round_trip_us}, **link},
            "faults": faults,
            **{name: facts[name] for name in TOLD if name in facts},  # type: ignore[literal-required]
            "verdict": {"word": word, "causes": causes},
        }

        def show(title: str, console: "Console") -> None:
            by_side = (f"{side} {name} {count}" for side, named in faults.items() for name, count in named.items())
            trip = "unknown" if self.round_trip_us is None else f"{1e-3 * self.round_trip_us:.2f} ms"
            lines = [
                f"{word}: {'; '.join(failed.values()) or facts.get('outcome', '')}",
                f"{title}  {self.duration_s:.1f} s",
                *(
                    f"{name.replace('_', ' ')}: {each['packets']} updates"
                    + ("" if each["reduction"] is None else f", {100.0 * each['reduction']:.1f} % fewer than ticks")
                    for name, each in packets.items()
                ),
                f"round trip {trip}; datagrams: {', '.join(f'{count} {name}' for name, count in link.items())}",
                *(f"{name}: {each['missed']} ticks missed" for name, each in ticks.items() if each["count"]),
                f"faults: {', '.join(by_side) or 'none'}",
                build(compiled=is_compiled()),
                *(f"felt error, delay, energy: {install_line(guest)}" for guest in set(REPORTS.absent().values())),
            ]
            console.print("\n".join(lines), markup=False, highlight=False)

        return Ended(exit_status(facts, failed=bool(failed)), document, show)

    def _packets(self) -> dict[str, dict[str, Any]]:
        """Updates of each stream, as its receiver counts them where the sender runs elsewhere."""
        found = {}
        for name, names in streams(self._system).items():
            sender, receiver = self.sides[name], self.sides[MASTER if name == SLAVE else SLAVE]
            seen, how = (sender, "sent") if sender.ticks else (receiver, "received")
            for place, stream in enumerate(names):
                count = seen.counter(f"{SECOND if place else ''}updates_{how}")
                reduction = 1.0 - count / seen.engaged if seen.engaged else None
                found[stream] = {"packets": count, "reduction": reduction}
        return found
