"""Energy at the two ports of a session, from telemetry, and its bound; energy to the robot is positive.

The device of the operator holds its force from tick k to the next while it moves from x_k to x_k+1, so the work of the
operator in that tick is exactly -output_k . (x_k+1 - x_k). At the robot, force and position change together, hence the
trapezoid -(f_k + f_k+1) / 2 . (p_k+1 - p_k) of the measured force over the commanded position. With six degrees of
freedom, torque does work over rotation in the same two ways.

The bound follows from records and the configuration alone: it does not ask the account. In a time t the hand gets at
most, more than it gave,

    allowance (for each session) + refill t + damping (integral of v^2 dt) + credit + the work of one tick         [J]

(`weberlink.control.account`). With six degrees of freedom the torque has an account too, and the bounds add.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from weberlink.config.model import ControlSettings, MappingSettings
from weberlink.control.contract import AccountParameters
from weberlink.protocol.states import State
from weberlink.session.composition.channels import account


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
        """Take the next steps.

        Args:
            records: of the master, shape (n + 1,): the first is the last one of the call before.
            ways: of each account, from each record to the next [m | rad], shape (n, axes).
            works: of the hand over each step, by account [J], shape (accounts, n).
            lost: whether records are missing between two, shape (n,).
            given: by the hand up to each record but the first [J], shape (n,).
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
    force and, with six degrees of freedom, that of the torque; or that of all axes of an arm.

    `damping` is that of angles [N m s] for torques. None of a scheme that keeps no account, or keeps one of its own.

    Raises:
        ValueError: it says something else of an account than this release does.
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
            return (_of_angles(force, LEVER),)
        return (force, _of_angles(torque, HANDLE))
    except (KeyError, TypeError, AttributeError) as error:
        raise ValueError(f"no settings of an account ({error!r})") from None


def _of_angles(of_hand: AccountParameters, lever: float) -> AccountParameters:
    return replace(of_hand, damping=of_hand.damping * lever**2)


Records = NDArray[Any]
"""Structured array of telemetry records."""
Series = NDArray[np.float64]


class PortWork:
    """Cumulative work at one port, tick by tick.

    Every tick counts, also out of session and in ramps. A step over records that the reader lost counts nothing; one
    over a missed tick counts, since the force was held.

    Args:
        force, position: columns of the record.
        held: whether the force is held over the tick; else it changes linearly.
        turns: rotation vectors from each row to the next [rad], for rotation vectors of shape (n, 3); None for a
            session of three degrees of freedom.
        turning: column of the rotation vectors; that of the position with `rotation_` before it if not given.
        bound: what may come out at this port; None where nothing bounds it.
    """

    def __init__(
        self,
        force: str,
        position: str,
        *,
        held: bool,
        turns: Callable[[Any], Series] | None = None,
        turning: str | None = None,
        bound: EnergyBound | None = None,
    ) -> None:
        self._force, self._position, self._held, self._turns = force, position, held, turns
        self._turning = turning or f"rotation_{position}"
        self.bound = bound
        self._last: Records | None = None
        self.total = 0.0
        """Up to the newest record [J]."""
        self.least = 0.0
        """The lowest value of the sum so far, at most 0 [J]."""

    def add(self, records: Records) -> Series:
        """Take the next records; returns the work done up to each of them [J], shape (n,)."""
        if not len(records):
            return np.empty(0)
        first = self._last is None
        joined = records if self._last is None else np.concatenate([self._last, records])
        self._last = records[-1:].copy()
        forces, ways = [joined[self._force]], [np.diff(joined[self._position], axis=0)]
        if self._turns is not None:
            forces.append(joined[f"rotation_{self._force}"])
            ways.append(self._turns(joined[self._turning]))
        missed = np.diff(joined["ticks_missed"].astype(np.int64))
        lost = np.diff(joined["tick"].astype(np.int64)) != 1 + missed
        works = np.array([self._work(force, way) for force, way in zip(forces, ways, strict=True)])
        works[:, lost] = 0.0
        steps = works.sum(axis=0)
        sums: Series = self.total + np.cumsum(np.concatenate([[0.0], steps]) if first else steps)
        self.total = float(sums[-1])
        self.least = min(self.least, float(sums.min()))
        if self.bound is not None:
            self.bound.add(joined, ways, works, lost, sums[1:] if first else sums)
        return sums

    def _work(self, force: Any, ways: Any) -> Series:
        """Work over each step, of a force over a displacement or a torque over a turn [J]."""
        between = force[:-1] if self._held else 0.5 * (force[:-1] + force[1:])
        return np.asarray(-(between * ways).sum(axis=1), dtype=np.float64)


class LinkEnergy:
    """Energy that went in at the port of the operator and did not come out at the robot, while both sides lead.

    That is while both are engaged and neither is in a ramp: before, the robot approaches on its own. A step counts if
    that holds at both of its ends. A negative sum is energy that the link generated, which includes the effect of
    holding the force over a tick.
    """

    def __init__(self) -> None:
        self._last: tuple[float, bool] | None = None
        self._total = 0.0
        self.least = 0.0
        """The lowest value of the sum so far, at most 0 [J]."""

    def add(self, given: Series, taken: Series, counts: NDArray[np.bool_]) -> None:
        """Take the next pairs, in order of time, without gaps.

        Args:
            given: work of the operator up to each [J], shape (n,).
            taken: work that came out at the robot's port [J], shape (n,).
            counts: whether both sides lead, shape (n,).
        """
        if not len(given):
            return
        held = given - taken
        if self._last is not None:
            held = np.concatenate([[self._last[0]], held])
            counts = np.concatenate([[self._last[1]], counts])
        self._last = (float(held[-1]), bool(counts[-1]))
        sums = self._total + np.cumsum(np.diff(held) * (counts[1:] & counts[:-1]))
        if len(sums):
            self._total = float(sums[-1])
            self.least = min(self.least, float(sums.min()))
