"""The felt error tick by tick, for a page to draw: the force on the operator's hand against the one the robot measured.

The same join and the same ticks as the figures of `weberlink.system.scoring.session`, which keep no rows.
"""

from typing import Any

import numpy as np

from weberlink.apps.monitor.pieces import joined
from weberlink.apps.monitor.samples import listed
from weberlink.protocol.states import State
from weberlink.system.scoring.session import Records
from weberlink.telemetry.reader import DTYPE

LONGEST_WAIT = 2500
"""Rows of a side that wait for those of the other; older ones are let go."""


class FeltError:
    """Joins shown rows of the slave with the records of the master nearest in time.

    Args:
        rate_hz: of both sides [Hz].
    """

    def __init__(self, rate_hz: float) -> None:
        self._period = 1.0 / rate_hz
        self._master: Records = np.empty(0, DTYPE)
        self._slave: Records = np.empty(0, DTYPE)

    def add(self, master: Records, slave_rows: Records) -> tuple[Records, Records]:
        """Take all next records of the master and the slave's rows; returns pairs that count, of equal length."""
        longest = max(LONGEST_WAIT, len(master), len(slave_rows))
        self._master = joined((self._master, master))[-longest:]
        self._slave = joined((self._slave, slave_rows))[-longest:]
        if not (len(self._master) and len(self._slave)):
            return self._master[:0], self._slave[:0]
        at = self._master["at"]
        ready = int(np.searchsorted(self._slave["at"], at[-1] - 0.5 * self._period, side="right"))
        now, self._slave = self._slave[:ready], self._slave[ready:]
        right = np.minimum(np.searchsorted(at, now["at"]), len(at) - 1)
        left = np.maximum(right - 1, 0)
        nearest = np.where(now["at"] - at[left] <= at[right] - now["at"], left, right)
        matched = self._master[nearest]
        if ready:
            self._master = self._master[max(0, int(nearest[-1]) - 1) :]
        counts = np.abs(matched["at"] - now["at"]) <= 0.75 * self._period
        for records in (matched, now):
            counts &= (records["state"] == State.ENGAGED.value) & (records["ramping"] == 0)
        return matched[counts], now[counts]


def message(master: Records, slave: Records, origin: float) -> dict[str, Any]:
    """The felt error of pairs of ticks [N] and in units of the deadband's bound; None where there is no bound."""
    error = np.linalg.norm(master["output"] - slave["raw"], axis=1)
    bound = slave["bound"]
    with np.errstate(divide="ignore", invalid="ignore"):
        jnd = np.where(bound > 0.0, error / bound, np.nan)
    return {
        "type": "felt",
        "t": listed(slave["at"] - origin, 6),
        "jnd": listed(jnd, 4),
        "error_n": listed(error, 5),
        "bound_n": listed(bound, 5),
    }
