"""The ends of live sessions on this host: the newest motion and force by axis, for programs with their own loop."""

from pathlib import Path
from time import monotonic
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from weberlink.config import MASTER, SLAVE
from weberlink.session.description import read as read_description
from weberlink.telemetry.reader import DTYPE, Records, RingReader
from weberlink.telemetry.record import AXES
from weberlink_figures.channel import GRIPPER, joints_in
from weberlink_figures.session import joined
from weberlink_figures.watching.rings import NoSessionError, RingFile, living_ring

STALE_S = 0.5  # age of the newest record from which its daemon stands still
# Vectors of a record: where the axes are, what they were commanded to, and the force or torque on them [m | rad, N |
# N m]. Of a robot that is led by a hand the position is not known: there it is what it was commanded.
FIELDS = {MASTER: ("position", "raw", "output"), SLAVE: ("position", "output", "raw")}


class Sample(NamedTuple):
    """The newest record, by axis."""

    at: float  # on the monotonic clock of this host [s]
    position: NDArray[np.float64]  # measured [rad, or m]
    command: NDArray[np.float64]  # [rad, or m]
    effort: NDArray[np.float64]  # torque [N m] or force [N]: on the operator (master), of the environment (slave)
    efforts: NDArray[np.float64]  # that of so many newest records, the oldest first: shape (ticks, axes)


class LiveEnd:
    """One end of a live session: reads its ring, and is not noticed by its daemon.

    A sample holds `ticks` of the newest records, at least 1. Raises NoSessionError if the daemon has ended meanwhile,
    RingFormatError or OSError if it is no ring that this release can read.
    """

    def __init__(self, ring: RingFile, ticks: int = 1) -> None:
        self.side, self.session, self._ticks, self._path = ring.side, ring.session, ticks, ring.path
        try:
            self._reader = RingReader(ring.path)
        except FileNotFoundError:
            raise NoSessionError(f"the {ring.side} of session {ring.session} has ended") from None
        self.description = read_description(ring.path) or {}
        joints = joints_in({"codec": self.system.get("codec", {})})
        self.is_arm = bool(joints)  # in joint space; else its axes are x, y and z
        self.has_gripper = GRIPPER in joints[-1:]
        self.names = joints or AXES  # of the axes, the gripper last
        where, *others = FIELDS[ring.side]
        self._fields = [where if joints or ring.side == MASTER else others[0], *others]
        self._recent: Records = np.empty(0, DTYPE)

    @property
    def system(self) -> dict[str, Any]:
        """The session's configuration; empty if unknown."""
        found: dict[str, Any] = self.description.get("system", {})
        return found

    def range_of(self, key: str) -> NDArray[np.float64]:
        """`lower_rad` or `upper_rad` of all axes, as the follower's daemon tells where it is on this host; else NaN."""
        follower = self._path.with_name(self._path.name.replace(f"-{MASTER}.", f"-{SLAVE}."))
        values = (read_description(follower) or self.description).get(key, [])
        known = len(values) == len(self.names)
        return np.asarray(values, np.float64) if known else np.full(len(self.names), np.nan)

    @property
    def pid(self) -> int:
        """Process id of the daemon."""
        return self._reader.pid

    @property
    def is_alive(self) -> bool:
        """Whether its daemon runs."""
        return self._reader.alive

    def sample(self) -> Sample:
        """The newest record. Copies what was written since the last call, and never waits. Raises NoSessionError if the
        daemon has ended, stands still, or has not begun.
        """
        new = self._reader.read()
        if len(new) >= self._ticks:
            self._recent = new[-self._ticks :]
        elif len(new):
            self._recent = joined([self._recent, new])[-self._ticks :]
        if not len(self._recent):
            raise NoSessionError(f"the {self.side} of session {self.session} has written nothing yet")
        last = self._recent[-1]
        age = monotonic() - float(last["at"])
        if not age < STALE_S:
            word = "stands still" if self._reader.alive else "has ended"
            raise NoSessionError(f"the {self.side} of session {self.session} {word}: no record for {age:.1f} s")
        axes = len(self.names)
        position, command = (last[name][:axes].copy() for name in self._fields[:2])
        efforts = self._recent[self._fields[2]][:, :axes]
        missing = np.repeat(efforts[:1], self._ticks - len(efforts), axis=0)
        return Sample(float(last["at"]), position, command, efforts[-1], np.concatenate([missing, efforts]))

    def close(self) -> None:
        self._reader.close()


def find_end(side: str, session: str | None = None, ticks: int = 1, where: Path | None = None) -> LiveEnd:
    """The one end of a live session on this host that has a name: `side` is master or slave, `ticks` as of `LiveEnd`,
    the others and the errors as of `weberlink_figures.watching.rings.living_ring`.
    """
    return LiveEnd(living_ring(side, session, where), ticks)
