"""Which differences between two records of a side are events, and what each is called. Owns no time and no output."""

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from weberlink.control.table import SCHEMES
from weberlink.protocol.states import State
from weberlink.telemetry.fault import Fault

Records = NDArray[Any]
Fields = dict[str, Any]


class Change(NamedTuple):
    """One event.

    Args:
        record: the first in which it is so.
        kind: events that take turns are of one kind, so that the last of their lines is how things are.
        event: its name.
        fields: what is told of it.
    """

    record: Any
    kind: str
    event: str
    fields: Fields


class Changes:
    """Follows the records of one side, from its first.

    Args:
        first: a record.
    """

    def __init__(self, first: Any) -> None:
        self.last = first
        self._fault_at_s = float(first["at"])

    def begin(self) -> Iterator[Change]:
        """What is so from the first record on, and is worth a line beside that it began."""
        if int(self.last["fault"]):
            yield Change(self.last, "fault", "fault", {"fault": fault_name(self.last)})

    def follow(self, records: Records) -> Iterator[Change]:
        """What differs from one record to the next, in order of time; then `last` is the last of them."""
        changed = np.zeros(len(records), np.bool_)
        for name in ("state", "fault", "control", "settings"):
            changed |= np.diff(records[name].astype(np.int64), prepend=int(self.last[name])) != 0
        for index in np.flatnonzero(changed).tolist():
            yield from self._between(records[index - 1] if index else self.last, records[index])
        self.last = records[-1]

    def _between(self, before: Any, record: Any) -> Iterator[Change]:
        if record["state"] != before["state"]:
            yield Change(record, "state", state_name(record), {"before": state_name(before)})
        if record["fault"] != before["fault"]:
            yield from self._faults(before, record)
        if record["control"] != before["control"]:
            yield Change(record, "scheme", "scheme", {"scheme": scheme_name(record), "before": scheme_name(before)})
        if record["settings"] != before["settings"]:
            yield Change(record, "settings", "settings", {"generation": int(record["settings"])})

    def _faults(self, before: Any, record: Any) -> Iterator[Change]:
        at = float(record["at"])
        if int(before["fault"]):
            fields = {"fault": fault_name(before), "lasted_s": round(at - self._fault_at_s, 6)}
            yield Change(record, "fault", "recovered", fields)
        if int(record["fault"]):
            self._fault_at_s = at
            yield Change(record, "fault", "fault", {"fault": fault_name(record)})


def state_name(record: Any) -> str:
    return _named(lambda number: State(number).name.lower(), int(record["state"]))


def fault_name(record: Any) -> str:
    return _named(lambda number: Fault(number).name.lower(), int(record["fault"]))


def scheme_name(record: Any) -> str:
    return _named(lambda number: list(SCHEMES)[number], int(record["control"]))


def _named(name: Callable[[int], str], number: int) -> str:
    """A name, or the number where a record holds one that nobody has named: a log does not stop there."""
    try:
        return name(number)
    except (ValueError, IndexError):
        return str(number)
