"""The figures of the rotation of a session: torque beside force, orientation beside position.

Fed with the records that `weberlink.system.scoring.session` has joined; knows nothing of how they belong together.
"""

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from weberlink.system.scoring.energy import Records, Series
from weberlink.system.scoring.errors import Errors, tally


class Counted(Protocol):
    """What is known of one side."""

    ticks: int
    engaged: int

    def counter(self, name: str) -> int:
        """The last value of a cumulative field."""
        ...


class RotationScore:
    """Errors of torque [N m] and orientation [rad], as the main score has them of force and position.

    The error of an orientation is the angle between what the tool was told and what the hand had. `reduction_all` and
    `bytes_per_s` are of a direction, not of a channel, and are with force and position.

    Args:
        period: of a tick [s].
        bank: names of the torque channel's predictors, in the order of selectors.
    """

    def __init__(self, period: float, bank: Sequence[str]) -> None:
        self._period = period
        self._bank = bank
        self._torque, self._coding, self._orientation = Errors(), Errors(), Errors()
        self._selected: dict[int, int] = {}

    def add(self, slave: Records, in_session: Records) -> None:
        """Take the next records of the slave, and those of them that say how well the link works."""
        if len(slave):
            tally(self._selected, slave["rotation_selected"][slave["rotation_sent"] > 0])
        if len(in_session):
            coded = _distance(in_session["rotation_decoded"], in_session["rotation_raw"])
            self._coding.add(coded, in_session["rotation_bound"].astype(np.float64))

    def compare(self, master: Records, slave: Records) -> None:
        """Take records of both sides that belong to the same moments."""
        felt = _distance(master["rotation_output"], slave["rotation_raw"])
        self._torque.add(felt, slave["rotation_bound"].astype(np.float64))
        turned = angles_between(slave["rotation_output"], master["rotation_raw"])
        self._orientation.add(turned, master["rotation_bound"].astype(np.float64))

    def summary(self, master: Counted, slave: Counted, duration: float) -> dict[str, Any]:
        """The blocks `torque` and `orientation` of a report."""
        return {
            "torque": self._channel(slave, master, duration, self._torque)
            | {
                "coding": self._coding.summary(self._period),
                "selected": {self._bank[i]: sends for i, sends in sorted(self._selected.items())},
            },
            "orientation": self._channel(master, slave, duration, self._orientation),
        }

    def _channel(self, sender: Counted, receiver: Counted, duration: float, errors: Errors) -> dict[str, Any]:
        """As seen by the receiver where the sender's records are on another host."""
        seen = sender if sender.ticks else receiver
        packets = seen.counter("rotation_updates_sent" if sender.ticks else "rotation_updates_received")
        return {
            "samples": seen.engaged,
            "packets": packets,
            "packets_per_s": packets / duration if duration else None,
            "reduction": 1.0 - packets / seen.engaged if seen.engaged else None,
        } | errors.summary(self._period)


def angles_between(a: NDArray[Any], b: NDArray[Any]) -> Series:
    """Angle [rad] of the rotation from one to the other, of rotation vectors [rad] row by row.

    Args:
        a: shape (n, 3).
        b: shape (n, 3).
    """
    return np.asarray(np.linalg.norm(turns_between(a, b), axis=1), dtype=np.float64)


def turns(rotations: NDArray[Any]) -> Series:
    """Rotation vectors [rad] that lead from each row to the next, in the frame of the rotations; shape (n - 1, 3)."""
    return turns_between(rotations[:-1], rotations[1:])


def turns_between(a: NDArray[Any], b: NDArray[Any]) -> Series:
    """Rotation vectors [rad], of at most half a turn, of b after the inverse of a, row by row; arguments as above."""
    (aw, av), (bw, bv) = (_quaternions(np.asarray(each, dtype=np.float64)) for each in (a, b))
    between = aw[:, None] * bv - bw[:, None] * av + np.cross(av, bv)
    scalar = aw * bw + np.einsum("ij,ij->i", av, bv)
    length = np.linalg.norm(between, axis=1)
    angle = 2.0 * np.arctan2(length, np.abs(scalar))
    # Of two quaternions of one rotation the vector part of one points the other way.
    sign = np.where(scalar < 0.0, -1.0, 1.0)
    factor = sign * np.divide(angle, length, out=np.full_like(length, 2.0), where=length > 0.0)
    return np.asarray(between * factor[:, None], dtype=np.float64)


def _quaternions(rotations: Series) -> tuple[Series, Series]:
    """Scalar and vector parts."""
    half = 0.5 * np.linalg.norm(rotations, axis=1)
    return np.cos(half), 0.5 * np.sinc(half / np.pi)[:, None] * rotations


def _distance(a: NDArray[Any], b: NDArray[Any]) -> Series:
    return np.asarray(np.linalg.norm(a - b, axis=1), dtype=np.float64)
