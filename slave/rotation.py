"""The rotation of the teleoperator's side: the tool is turned as the hand is, the torque on it goes back.

Owns the second stream of a session, and exists only where the file asks for six degrees of freedom. Decides nothing of
the session: the loop says when the tool may follow, and when its torque is sent.
"""

from weberlink.codec import Decoder, Encoder, Update
from weberlink.geometry.rotation import IDENTITY, Quaternion, quaternion, toward, vector
from weberlink.geometry.vector import ZERO, Vector, norm
from weberlink.slave.robots.contract import OrientedRobot
from weberlink.slave.safety import Follower
from weberlink.telemetry.record import RotationRecord

LARGEST = 1e9
"""No torque is as large [N m]; a record has room for it."""


class ToolRotation:
    """Orientation decoder, torque encoder, and the guard between the decoded orientation and the tool.

    Args:
        robot: that holds the tool.
        encoder: of the backward (torque) channel.
        decoder: of the forward (orientation) channel.
        speed: largest angular speed while following [rad/s].
        approach_speed: angular speed of the approach after an engagement [rad/s].
        ramp: time in which the torque fades in [s].
    """

    def __init__(
        self,
        *,
        robot: OrientedRobot,
        encoder: Encoder,
        decoder: Decoder,
        speed: float,
        approach_speed: float,
        ramp: float,
    ) -> None:
        self.encoder = encoder
        self.decoder = decoder
        self.guard = Follower[Quaternion](IDENTITY, toward, speed=speed, approach_speed=approach_speed, ramp=ramp)
        self._robot = robot
        self._applied: Vector = ZERO
        self._torque: Vector = ZERO
        self._held: Vector = ZERO
        self._sent_at = -1

    def reset(self) -> None:
        """A new session: the other end holds nothing, and the tool must find to where the hand is."""
        self.encoder.reset()
        self.decoder.reset()
        self.guard.reset()

    def move(self, commanded: Vector | None, elapsed: float, now: float) -> None:
        """Turn the tool, or hold.

        Args:
            commanded: the decoded rotation vector [rad]; None without a peer.
            elapsed: since the last call [s].
            now: [s].
        """
        if commanded is None:
            held = self.guard.hold(elapsed)
        else:
            goal = quaternion(commanded)
            held = self.guard.follow(goal, elapsed)
            self._applied = commanded if held == goal else vector(held, self._applied)
        self._robot.point(held, now)

    def hold(self, now: float) -> None:
        """Hold where it is, at once."""
        self._robot.point(self.guard.hold(0.0), now)

    def feel(self, torque: Vector) -> bool:
        """Take the measured torque [N m]; False, and the last one stays, if no sensor can mean it."""
        if not norm(torque) < LARGEST:
            return False
        self._torque = torque
        return True

    def encode(self, index: int, shown: Vector) -> Update | None:
        """The update of this tick, if one must be sent.

        Args:
            index: of the tick.
            shown: the torque that may be shown to the operator [N m].
        """
        update = self.encoder.encode(index, shown, self._applied)
        if update is not None:
            self._sent_at = index
        newest = self.encoder.mirror.newest
        self._held = (newest.value if update is not None and newest is not None else self.encoder.predicted) or ZERO
        return update

    @property
    def torque(self) -> Vector:
        """As measured last [N m]."""
        return self._torque

    def record(self, tick: int, sent: int, received: int) -> RotationRecord:
        """Its part of the record of the tick just done.

        Args:
            tick: its number.
            sent: updates of the rotation so far.
            received: likewise, of the peer's.
        """
        return RotationRecord(
            sent,
            received,
            *self._torque,
            *self._held,
            *self._applied,
            self.encoder.bound,
            self.encoder.mirror.selected,
            self._sent_at == tick,
        )
