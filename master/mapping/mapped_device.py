"""A haptic device in the frame of the robot, with a clutch."""

from dataclasses import dataclass, replace

from weberlink.geometry.rotation import IDENTITY, Quaternion, inverse, product
from weberlink.geometry.vector import ZERO, Vector, add, is_finite, norm, scale, subtract
from weberlink.master.devices.contract import Device, DeviceReading, DeviceSpec, ReportsTrouble, TorqueDevice
from weberlink.master.mapping.frame import FrameMap, Walls


class Clutch:
    """Keeps the offset between hand and robot.

    Args:
        button: which one disengages, from 0.
    """

    __slots__ = ("_button", "_held", "_held_turn", "_index", "_turn")

    def __init__(self, button: int) -> None:
        self._button = button
        self._index: Vector = ZERO
        self._held: Vector | None = None
        self._turn: Quaternion = IDENTITY
        self._held_turn: Quaternion | None = None

    def reset(self) -> None:
        """Engage, without an offset between hand and robot."""
        self._index, self._held = ZERO, None
        self._turn, self._held_turn = IDENTITY, None

    @property
    def engaged(self) -> bool:
        """Whether the robot follows the hand."""
        return self._held is None

    def pass_through(self, position: Vector, buttons: int, keep: Vector | None) -> Vector:
        """The position for the robot.

        Args:
            position: of the hand, mapped, without any indexing [m].
            buttons: that are pressed, a bit each.
            keep: where the robot was last; what it stays at while disengaged. None before the first reading, which
                engages whatever is pressed.
        """
        if buttons >> self._button & 1 and keep is not None:
            if self._held is None:
                self._held = keep
            return self._held
        if self._held is not None:
            self._index = subtract(self._held, position)
            self._held = None
        return add(position, self._index)

    def pass_orientation(self, orientation: Quaternion, keep: Quaternion | None) -> Quaternion:
        """The orientation for the tool; call after `pass_through`, which evaluates the button.

        Args:
            orientation: of the handle, mapped, without any indexing.
            keep: that of the tool at the last reading; None before the first.
        """
        if self._held is not None:
            if self._held_turn is None:
                self._held_turn = orientation if keep is None else keep
            return self._held_turn
        if self._held_turn is not None:
            # On the right, so that a turn of the hand about an axis stays one of the tool about the same axis.
            self._turn = product(inverse(orientation), self._held_turn)
            self._held_turn = None
        return orientation if self._turn == IDENTITY else product(orientation, self._turn)


LONGEST_PAUSE = 0.1
"""After a longer pause between two commands [s], walls and force fade in again."""


@dataclass
class _Session:
    """State since the device was opened."""

    read: DeviceReading | None = None
    mapped: DeviceReading | None = None
    beyond: Vector = ZERO
    commanded_at: float | None = None
    gain: float = 1.0
    wall_gain: float = 0.0


class MappedDevice:
    """Maps the readings and the commands of another device.

    The force of the robot fades out while the clutch is held, and in again after it. The walls fade in after `open`, so
    that they do not hit a hand that starts beyond one; they act without a peer too. The sum never exceeds
    `force_limit`.

    Args:
        device: in its own frame.
        frame: between the two frames.
        clutch: None for none.
        walls: None for none.
        force_limit: largest force on the hand [N].
        ramp: time in which a force fades [s], > 0.
    """

    def __init__(
        self,
        device: Device,
        frame: FrameMap,
        *,
        clutch: Clutch | None,
        walls: Walls | None,
        force_limit: float,
        ramp: float,
    ) -> None:
        self._device = device
        self._frame = frame
        self._clutch = clutch
        self._walls = walls
        own = device.spec
        self._limit = min(force_limit, own.force_n) if own.force_feedback else force_limit
        self._ramp = ramp
        self.spec: DeviceSpec = replace(
            own,
            axes=frame.axes(own.axes),
            force_n=self._limit / frame.force_scale if own.force_feedback else 0.0,
            stiffness_n_m=own.stiffness_n_m / (frame.force_scale * frame.motion_scale),
            workspace_m=frame.box(own.workspace_m) if walls is None else walls.box,
            torque_n_m=own.torque_n_m / frame.force_scale,
        )
        self._turns = device if isinstance(device, TorqueDevice) and own.torque_n_m > 0.0 else None
        self._session = _Session()

    @property
    def trouble(self) -> str | None:
        return self._device.trouble if isinstance(self._device, ReportsTrouble) else None

    def open(self, now: float) -> None:
        self._session = _Session()
        if self._clutch is not None:
            self._clutch.reset()
        self._device.open(now)

    def latest(self, now: float) -> DeviceReading:
        session, reading = self._session, self._device.latest(now)
        if session.mapped is not None and reading == session.read:
            return session.mapped
        position = self._frame.position(reading.position)
        if self._clutch is not None:
            keep = None if session.mapped is None else session.mapped.position
            position = self._clutch.pass_through(position, reading.buttons, keep)
        if self._walls is not None and is_finite(position):
            session.beyond = self._frame.way(self._walls.beyond(position))
            position = self._walls.inside(position)
        orientation = None if reading.orientation is None else self._orientation(reading.orientation)
        session.read = reading
        session.mapped = reading._replace(position=position, orientation=orientation)
        return session.mapped

    def command(self, force: Vector, now: float) -> None:
        if not is_finite(force):
            raise ValueError(f"{self.spec.name}: commanded a force that is not finite: {force}")
        session = self._session
        elapsed = 0.0 if session.commanded_at is None else now - session.commanded_at
        session.commanded_at = now
        if elapsed > LONGEST_PAUSE:
            elapsed = session.gain = session.wall_gain = 0.0
        share = elapsed / self._ramp
        engaged = self._clutch is None or self._clutch.engaged
        session.gain = min(1.0, session.gain + share) if engaged else max(0.0, session.gain - share)
        on_hand = scale(self._frame.force(force), session.gain)
        if self._walls is not None:
            session.wall_gain = min(1.0, session.wall_gain + share)
            on_hand = add(on_hand, scale(self._walls.force(session.beyond), session.wall_gain))
        length = norm(on_hand)
        self._device.command(on_hand if length <= self._limit else scale(on_hand, self._limit / length), now)

    def turn(self, torque: Vector, now: float) -> None:
        """Fades with the clutch like the force of the last `command`; no effect on a device without torque."""
        if not is_finite(torque):
            raise ValueError(f"{self.spec.name}: commanded a torque that is not finite: {torque}")
        if self._turns is not None:
            self._turns.turn(scale(self._frame.torque(torque), self._session.gain), now)

    def close(self) -> None:
        self._device.close()

    def _orientation(self, handle: Quaternion) -> Quaternion:
        mapped, last = self._frame.orientation(handle), self._session.mapped
        if self._clutch is None:
            return mapped
        return self._clutch.pass_orientation(mapped, None if last is None else last.orientation)
