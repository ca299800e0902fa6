"""Leads a session from a program on the same host, and names and scales its axes as LeRobot does."""

import fcntl
import os
from collections.abc import Mapping
from math import degrees
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from weberlink.config import MASTER
from weberlink.geometry.joints import Joints
from weberlink_arms.live_ends import LiveEnd, find_end
from weberlink_arms.remote_leader import limits, pack_angles
from weberlink_figures.watching.rings import NoSessionError
from weberlink_pointer.target_link import LEADER, Sender, lock_of


class TargetInUseError(RuntimeError):
    """Another process leads the arm."""


class LeaderSender(Sender):
    """Leads the arm of the daemon with a process id, alone, until it is closed.

    Raises FileNotFoundError if there is no such daemon, or its arm is no `remote_leader`; TargetInUseError if another
    process leads it; OSError if the socket cannot be used, or is another user's.
    """

    def __init__(self, pid: int) -> None:
        super().__init__(pid, LEADER)
        try:
            self._lock = self._locked(lock_of(self.connect()))
        except BaseException as error:
            self.disconnect()
            if isinstance(error, ConnectionRefusedError):  # the daemon was killed
                raise FileNotFoundError(f"no daemon with process id {pid} has a remote leader") from None
            raise
        self._angles: Joints | None = None

    @staticmethod
    def _locked(path: Path) -> int:
        lock = os.open(path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC, 0o600)
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            os.close(lock)
            raise TargetInUseError(f"another process leads this arm already ({path}); end it first") from None
        return lock

    def send(self, angles: Joints) -> None:
        """Lead to these angles of all axes [rad]; ValueError if one is not finite. Repeat it, at 30 Hz for example: a
        sender that is silent has let go.
        """
        data = pack_angles(angles, True, self.number())
        self._angles = angles
        if self.is_connected:  # else the daemon has ended; one that follows it is another's to lead
            self.send_datagram(data)

    def close(self) -> None:
        """Let go, and let another process lead; may be repeated."""
        if self.is_connected and self._angles is not None:
            self.send_datagram(pack_angles(self._angles, False, self.number()))
        self.disconnect()
        if self._lock >= 0:
            os.close(self._lock)
            self._lock = -1

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class NotRemoteError(RuntimeError):
    """No program may lead this session; the message says what to do."""


class RemoteLead:
    """Has the lead of a session, of which `session` and `where` are as of `find_end`, until it is closed.

    Raises NoSessionError if there is none, NotRemoteError if its leader is not for programs, TargetInUseError if
    another process leads it.
    """

    def __init__(self, session: str | None = None, where: Path | None = None) -> None:
        self._end = find_end(MASTER, session, where=where)
        try:
            master = self._end.system.get("master", {})
            device = dict(master.get("device") or {})
            driver = device.pop("driver", "no arm")
            if driver != "remote_leader":
                raise NotRemoteError(  # noqa: TRY301
                    f"{driver} leads this session: to look on, observe; to lead it, give its file"
                    " master.device {driver: remote_leader}"
                )
            if master.get("joint_mapping") is not None:
                raise NotRemoteError(  # noqa: TRY301
                    "a remote_leader is led in the follower's angles; leave out master.joint_mapping"
                )
            self._lower, self._upper = map(np.array, limits(device))
            self._sender = LeaderSender(self._end.pid)
        except FileNotFoundError:
            self._end.close()
            raise NoSessionError(f"the master of session {self._end.session} has ended") from None
        except BaseException:
            self._end.close()
            raise

    @property
    def is_alive(self) -> bool:
        """Whether the daemon of the master runs."""
        return self._end.is_alive

    def send(self, angles: Joints) -> NDArray[np.float64]:
        """Lead to these angles of all axes [rad]; returns them within the leader's limits, as they were sent.
        ValueError if one is not finite, or there are more or fewer than axes.
        """
        if len(angles) != len(self._lower):
            raise ValueError(f"expected {len(self._lower)} angles, not {len(angles)}")
        sent = np.clip(angles, self._lower, self._upper)
        self._sender.send(tuple(sent.tolist()))
        return sent

    def close(self) -> None:
        """Let go; may be repeated."""
        self._sender.close()
        self._end.close()


class AxisUnits:
    """The axes of one end of a session as LeRobot names and scales them: `NAME.pos`, `NAME.torque`.

    It gives a joint in degrees or as a share of its range, -100 to 100, and a gripper as 0 (closed) to 100. A joint in
    degrees is 0 where it is 0 rad for the session. Shares are of the range in which the follower may be
    commanded, or of the leader's where the follower is on another host; they are clipped as LeRobot does. A Cartesian
    session has x, y and z in metres, and `NAME.force` [N]. Raises ValueError if a range is needed and not known.
    """

    def __init__(self, end: LiveEnd, *, use_degrees: bool) -> None:
        self.names = end.names
        self.positions = [f"{name}.pos" for name in end.names]  # names of the features of motion
        effort = "torque" if end.is_arm else "force"
        self.efforts = [f"{name}.{effort}" for name in end.names]  # of torque [N m], or of force [N]
        count = len(end.names)
        self._factor, self._offset = np.ones(count), np.zeros(count)
        self._least, self._most = np.full(count, -np.inf), np.full(count, np.inf)
        if not end.is_arm:
            return
        lower, upper = end.range_of("lower_rad"), end.range_of("upper_rad")
        for i, name in enumerate(end.names):
            if name == end.names[-1] and end.has_gripper:
                self._share(i, lower, upper, 0.0)
            elif use_degrees:
                self._factor[i] = degrees(1.0)
            else:
                self._share(i, lower, upper, -100.0)

    def _share(self, i: int, lower: NDArray[np.float64], upper: NDArray[np.float64], least: float) -> None:
        if not upper[i] > lower[i]:
            raise ValueError(f"the session does not tell the range of {self.names[i]}; use the same release")
        self._least[i], self._most[i] = least, 100.0
        self._factor[i] = (100.0 - least) / (upper[i] - lower[i])
        self._offset[i] = least - self._factor[i] * lower[i]

    def features(self, values: NDArray[np.float64]) -> dict[str, float]:
        """Features of angles [rad], or of positions [m]."""
        scaled = np.clip(values * self._factor + self._offset, self._least, self._most)
        return dict(zip(self.positions, scaled.tolist(), strict=True))

    def values(self, action: Mapping[str, Any]) -> tuple[float, ...]:
        """Angles [rad] or positions [m] of an action; ValueError if a feature is missing."""
        missing = [name for name in self.positions if name not in action]
        if missing:
            raise ValueError(f"the action lacks {', '.join(missing)}; it has {', '.join(action)}")
        given = np.clip([float(action[name]) for name in self.positions], self._least, self._most)
        return tuple(((given - self._offset) / self._factor).tolist())

    def window_names(self, ticks: int) -> list[str]:
        """Names of the features of a window of torques, tick by tick, the oldest first."""
        return [f"{name}.{tick}" for tick in range(ticks) for name in self.efforts]
