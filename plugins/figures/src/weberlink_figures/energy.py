"""Energy at the port of the operator, from telemetry, and its bound; energy to the robot is positive.

The device of the operator holds its force from tick k to the next while it moves from x_k to x_k+1, so the work of the
operator in that tick is exactly -output_k . (x_k+1 - x_k). With six degrees of freedom, torque does work over rotation.

The bound follows from records and the configuration alone: it does not ask the account. In a time t the hand gets at
most, more than it gave,

    allowance (for each session) + refill t + damping (integral of v^2 dt) + credit + the work of one tick         [J]

(`weberlink.control.account`). With six degrees of freedom the torque has an account too, and the bounds add.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from weberlink.config.model import ControlSettings, MappingSettings
from weberlink.control.contract import AccountParameters
from weberlink.protocol.states import State
from weberlink.session.composition.channels import account
from weberlink.telemetry.reader import Records
from weberlink.telemetry.record import FORCE, TORQUE
from weberlink_figures.channel import Series, turns_between


class EnergyBound:
    """What may come out at the port of the operator, and the largest share of it that did.

    Before the first record, and between two where records were lost, the hand may have put in what is not seen: there,
    what the account says to hold counts as allowed.

    Args:
        accounts: of the force and, with six degrees of freedom, of the torque (`accounts_in`).

    Attributes:
        share: the largest one so far, 0 or more; above 1 the bound was broken.
        allowed: energy allowed until now [J]; it grows with time and motion.
    """

    def __init__(self, accounts: Sequence[AccountParameters]) -> None:
        self._accounts = accounts
        self._granted: float | None = None
        self._largest = np.zeros((len(accounts), 1))
        self.share = self.allowed = 0.0

    def add(
        self,
        records: NDArray[Any],
        ways: Sequence[NDArray[Any]],
        works: NDArray[np.float64],
        lost: NDArray[np.bool_],
        given: NDArray[np.float64],
    ) -> None:
        """Take the next n steps of the master.

        Args:
            records: shape (n + 1,): the first is the last one of the call before.
            ways: of each account, from each record to the next [m | rad], shape (n, axes).
            works: of the hand over each step, by account [J], shape (accounts, n).
            lost: whether records are missing between two.
            given: by the hand up to each record but the first [J].
        """
        energy, credit = (np.asarray(records[name], dtype=np.float64) for name in ("energy", "credit"))
        linked = np.isin(records["state"], (State.ENGAGED.value, State.SILENT.value))
        allowance = sum(each.allowance for each in self._accounts)
        if self._granted is None:
            self._granted = max(allowance, float(energy[0])) if linked[0] else 0.0
        if not len(given):
            return
        elapsed = np.diff(records["at"])
        gained = np.where(np.diff(credit) < 0.0, credit[1:], np.diff(credit))  # a new session counts from 0
        gained += allowance * (linked[1:] & ~linked[:-1]) + np.where(lost, np.maximum(np.diff(energy), 0.0), 0.0)
        per_second = np.divide(1.0, elapsed, out=np.zeros_like(elapsed), where=(elapsed > 0.0) & ~lost)
        for each, way in zip(self._accounts, ways, strict=True):
            squares = np.square(way, dtype=np.float64).sum(axis=1)
            gained += each.refill * elapsed + each.damping * squares * per_second
        granted = self._granted + np.cumsum(gained)
        self._granted = float(granted[-1])
        largest = np.maximum.accumulate(np.hstack([self._largest, -works]), axis=1)[:, 1:]
        self._largest = largest[:, -1:]
        allowed = granted + largest.sum(axis=0)
        shares = np.divide(-given, allowed, out=np.zeros_like(given), where=(given < 0.0) & (allowed > 0.0))
        self.share = max(self.share, float(shares.max()))
        self.allowed = float(allowed[-1])


def accounts_in(dump: Mapping[str, Any]) -> tuple[AccountParameters, ...]:
    """The accounts in the dump of a `System`, as descriptions and recordings hold it, in the robot's frame: that of the
    force and, with six degrees of freedom, that of the torque; or that of all axes of an arm. None of a scheme that
    keeps no account, or one of its own; ValueError if it says something else of an account than this release does.

    `damping` is that of angles [N m s] for torques.
    """
    try:
        if dump.get("control", {}).get("scheme") != "bounded":
            return ()
        control, mapped, codec = ControlSettings(**dump["control"]), dump["master"]["mapping"], dump["codec"]
        mapping = None if mapped is None else MappingSettings(**mapped)
        force, torque = (account(control, mapping, turns=turns) for turns in (False, True))
        if codec["joints"] is None and codec["rotation"] is None:
            return (force,)
        from weberlink.control.axes import HANDLE, LEVER  # noqa: PLC0415 - for what turns alone

        if codec["joints"] is not None:
            return (replace(force, damping=force.damping * LEVER**2),)
        return (force, replace(torque, damping=torque.damping * HANDLE**2))
    except (KeyError, TypeError, AttributeError) as error:
        raise ValueError(f"no settings of an account ({error!r})") from None


class PortWork:
    """Cumulative work at the port of the operator, tick by tick.

    Every tick counts, also out of session and in ramps. A step over records that the reader lost counts nothing; one
    over a missed tick counts, since the force was held.

    Args:
        rotates: whether torque does work over rotation too.
        bound: what may come out at this port; None where nothing bounds it.

    Attributes:
        total: up to the newest record [J].
        least: the lowest value of the sum so far, at most 0 [J].
    """

    def __init__(self, *, rotates: bool = False, bound: EnergyBound | None = None) -> None:
        self._rotates = rotates
        self.bound = bound
        self._last: Records | None = None
        self.total = self.least = 0.0

    def add(self, records: Records) -> Series:
        """Take the next records; returns the work done up to each of them [J], shape (n,)."""
        if not len(records):
            return np.empty(0)
        first = self._last is None
        joined = records if self._last is None else np.concatenate([self._last, records])
        self._last = records[-1:].copy()
        forces, places = [joined["output"]], joined["position"]
        ways = [np.diff(places, axis=0)]
        if self._rotates:
            forces = [forces[0][:, FORCE], forces[0][:, TORQUE]]
            ways = [ways[0][:, FORCE], turns_between(places[:-1, TORQUE], places[1:, TORQUE])]
        missed = np.diff(joined["ticks_missed"].astype(np.int64))
        lost = np.diff(joined["tick"].astype(np.int64)) != 1 + missed
        works = np.array([-(force[:-1] * way).sum(axis=1) for force, way in zip(forces, ways, strict=True)], np.float64)
        works[:, lost] = 0.0
        steps = works.sum(axis=0)
        sums: Series = self.total + np.cumsum(np.concatenate([[0.0], steps]) if first else steps)
        self.total = float(sums[-1])
        self.least = min(self.least, float(sums.min()))
        if self.bound is not None:
            self.bound.add(joined, ways, works, lost, sums[1:] if first else sums)
        return sums
