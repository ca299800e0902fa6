"""The rotation of the operator's side: the hand's orientation goes out, the torque on it comes back.

Owns the second stream of a session, and exists only where the file asks for six degrees of freedom. Decides nothing of
the session: the loop says when it is heard, sent and rendered, and the gate of the force fades the torque too.
"""

from math import pi

from weberlink.codec import Decoder, Encoder, Update
from weberlink.geometry.rotation import Quaternion, unit_quaternion, vector
from weberlink.geometry.vector import ZERO, Vector, distance
from weberlink.master.devices.contract import TorqueDevice
from weberlink.master.safety import ForceGate, ForceLimiter, SlewLimiter
from weberlink.telemetry.record import RotationRecord


class HandRotation:
    """Orientation encoder, torque decoder and torque limit.

    Args:
        device: that turns the hand; None where nothing does, and only the orientation is sent.
        encoder: of the forward (orientation) channel.
        decoder: of the backward (torque) channel.
        limiter: bounds the torque.
        slew: bounds how fast the torque changes.
    """

    def __init__(
        self,
        *,
        device: TorqueDevice | None,
        encoder: Encoder,
        decoder: Decoder,
        limiter: ForceLimiter,
        slew: SlewLimiter,
    ) -> None:
        self.encoder = encoder
        self.decoder = decoder
        self._device = device
        self._limiter = limiter
        self._slew = slew
        self._turned: Vector = ZERO
        self._decoded: Vector = ZERO
        self._output: Vector = ZERO
        self._sent_at = -1

    @property
    def clipped(self) -> bool:
        """Whether the torque of the tick just done was limited."""
        return self._limiter.clipped

    def reset(self) -> None:
        """A new session: the other end holds nothing."""
        self.encoder.reset()
        self.decoder.reset()

    def read(self, orientation: Quaternion | None) -> bool:
        """Take the orientation of the handle; False, and the last one stays, if it is none."""
        usable = None if orientation is None else unit_quaternion(orientation)
        if usable is None:
            return False
        turned = vector(usable, self._turned)
        if distance(turned, self._turned) > pi:
            # Another vector of nearly the same rotation: a new signal, which nothing before it may extrapolate.
            self.encoder.reset()
        self._turned = turned
        return True

    def encode(self, index: int) -> Update | None:
        """The update of this tick, if one must be sent."""
        update = self.encoder.encode(index, self._turned)
        if update is not None:
            self._sent_at = index
        return update

    def decode(self, tick: float) -> None:
        """The torque at the device's own orientation now; `tick` is of the peer, as far as it can have been heard."""
        self._decoded = self.decoder.value(tick, self._turned) or ZERO

    def render(self, gate: ForceGate, now: float, step: float | None) -> bool:
        """Display the torque just decoded.

        Args:
            gate: through which the force of this tick has passed.
            now: [s].
            step: by how much the slew limit may go on [s]; None where the gate was closed before this tick.

        Returns:
            Whether the slew limit held the torque back.
        """
        limited = self._limiter.limit(self._decoded)
        self._output = gate.share(self._slew.place(limited) if step is None else self._slew.limit(limited, step))
        if self._device is not None:
            self._device.turn(self._output, now)
        return self._slew.limited

    def relax(self, now: float) -> None:
        """No torque, at once."""
        if self._device is not None:
            self._device.turn(ZERO, now)

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
            *self._turned,
            *self._decoded,
            *self._output,
            self.encoder.bound,
            self.decoder.selected,
            self._sent_at == tick,
        )
