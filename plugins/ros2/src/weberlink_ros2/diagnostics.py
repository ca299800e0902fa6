"""The condition of each side of a session, once a second, in the words of the log file."""

from collections.abc import Mapping
from enum import IntEnum
from math import isfinite
from typing import Any, NamedTuple

import numpy as np

from weberlink.protocol.states import State
from weberlink.telemetry.fault import Fault, name_of
from weberlink.telemetry.reader import Records
from weberlink.telemetry.record import RELEASED
from weberlink_figures.watching.rings import RingSource
from weberlink_figures.wording import ALARM, INFO, WARN, Words, fault_words, words

STALE_S = 1.0  # a side that has written no record for this long stands still [s]


class Level(IntEnum):
    """As the levels of diagnostic_msgs/DiagnosticStatus."""

    OK = 0
    WARN = 1
    ERROR = 2
    STALE = 3


_LEVELS = {INFO: Level.OK, WARN: Level.WARN, ALARM: Level.ERROR}


class Status(NamedTuple):
    """The condition of one part; `hardware` is the host or user that runs it, `values` are figures by name."""

    level: Level
    name: str
    message: str
    hardware: str
    values: dict[str, str]


class SideCondition:
    """What is known of one side since it was last asked."""

    def __init__(self, source: RingSource, now: float) -> None:
        self._source = source
        self._asked_at = self._heard_at = now
        self._last: Any = None
        self._before: Any = None  # the newest record when it was last asked
        self._latest_us = self._longest_us = 0.0

    def take(self, records: Records, now: float) -> None:
        """New records, at least one."""
        self._heard_at, self._last = now, records[-1]
        self._latest_us = max(self._latest_us, float(np.max(records["lateness_us"])))
        self._longest_us = max(self._longest_us, float(np.max(records["work_us"])))

    def status(self, now: float) -> Status:
        """Its condition, also once it has ended; figures per second are those since the last call."""
        source, silence_s, values = self._source, now - self._heard_at, dict[str, str]()
        described = source.description or {}
        if source.drained and source.in_order:
            level, text = Level.STALE, "ended"
        elif source.drained:
            level, text = Level.ERROR, "ended without closing its telemetry: it was killed or has crashed"
        elif silence_s > STALE_S:
            level, text = Level.STALE, f"stands still: no record for {silence_s:.1f} s"
        elif self._last is None:
            level, text = Level.OK, "has written no record yet"
        else:
            told = _condition(source, self._last)
            level, text = _LEVELS[told.level], told.text
        if self._last is not None and not source.drained:
            values = self._values(described, max(now - self._asked_at, 1e-3))
        self._asked_at, self._before = now, self._last
        self._latest_us = self._longest_us = 0.0
        return Status(level, f"weberlink: {source.side}", text, str(described.get("name", "")), values)

    def _values(self, described: Mapping[str, Any], interval_s: float) -> dict[str, str]:
        last = self._last

        def per_second(counter: str) -> float:
            before = 0 if self._before is None else int(self._before[counter])
            return max(0, int(last[counter]) - before) / interval_s

        bank = list(described.get("bank", ()))
        figures = {
            "tick lateness, largest [us]": self._latest_us,
            "tick work, largest [us]": self._longest_us,
            "ticks missed": int(last["ticks_missed"]),
            "updates sent [1/s]": per_second("updates_sent"),
            "updates received [1/s]": per_second("updates_received"),
            "datagrams lost": int(last["datagrams_lost"]),
            "datagrams dropped": int(last["datagrams_dropped"]),
            "energy account [J]": float(last["energy"]),
            "round trip [ms]": 1e-3 * float(last["rtt_us"]),
            "one way [ms]": 1e-3 * float(last["one_way_us"]),
            "Weber factor": float(last["weber"]),
        }
        if self._before is not None:
            figures = {"ticks [1/s]": per_second("tick")} | figures
        selected = int(last["selected"])
        predictor = bank[selected] if selected < len(bank) else str(selected)
        names = {"state": name_of(State, last["state"]), "predictor": predictor}
        return names | {name: f"{value:.6g}" if isfinite(value) else "unknown" for name, value in figures.items()}


def _condition(source: RingSource, last: Any) -> Words:
    """The fault if there is one, else the state, or that the button is not held."""
    if last["fault"]:
        return fault_words(source.side, name_of(Fault, last["fault"]))
    if last["ramping"] == RELEASED:
        return words(source.side, "released", {})
    return words(source.side, name_of(State, last["state"]), {})
