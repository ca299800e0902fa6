"""Leads the `remote_leader` arm of a live session on this host, for programs with a loop of their own."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from weberlink.cli.live_ends import LiveEnd, NoSessionError, find_end
from weberlink.config import MASTER
from weberlink.geometry.joints import Joints
from weberlink.master.devices.remote_leader import limits
from weberlink.master.devices.target_link import TargetWriter


class NotRemoteError(RuntimeError):
    """No program may lead this session; the message says what to do."""


class RemoteLead:
    """Has the lead of a session until it is closed.

    Args:
        session: as of `find_end`.
        where: as of `find_end`.

    Raises:
        NoSessionError: there is no such session.
        NotRemoteError: its leader is not for programs.
        TargetInUseError: another process leads it.
    """

    def __init__(self, session: str | None = None, where: Path | None = None) -> None:
        self._end = find_end(MASTER, session, where=where)
        try:
            lower, upper = _limits(self._end)
            self._lower: NDArray[np.float64] = np.array(lower)
            self._upper: NDArray[np.float64] = np.array(upper)
            self._writer = TargetWriter(self._end.pid)
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

        Raises:
            ValueError: an angle is not finite, or there are more or fewer than axes.
        """
        if len(angles) != len(self._lower):
            raise ValueError(f"expected {len(self._lower)} angles, not {len(angles)}")
        sent = np.clip(angles, self._lower, self._upper)
        self._writer.write(tuple(sent.tolist()))
        return sent

    def close(self) -> None:
        """Let go; may be repeated."""
        self._writer.close()
        self._end.close()


def _limits(end: LiveEnd) -> tuple[Joints, Joints]:
    """Least and largest angles that the leader takes [rad]; raises NotRemoteError."""
    master = end.system.get("master", {})
    device = dict(master.get("device") or {})
    driver = device.pop("driver", "no arm")
    if driver != "remote_leader":
        raise NotRemoteError(
            f"{driver} leads this session: to look on, observe; to lead it, give its file"
            " master.device {driver: remote_leader}"
        )
    if master.get("joint_mapping") is not None:
        raise NotRemoteError("a remote_leader is led in the follower's angles; leave out master.joint_mapping")
    return limits(device)
