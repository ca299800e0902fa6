"""A haptic device in the frame of the robot, with a clutch."""

from dataclasses import replace

from weberlink.geometry.rotation import IDENTITY, Quaternion, inverse, product
from weberlink.geometry.vector import ZERO, Vector, add, is_finite, scale, subtract, within
from weberlink.master.devices.contract import Device, DeviceReading, DeviceSpec, TorqueDevice, check_finite
from weberlink.master.mapping.frame import FrameMap, Walls


class Clutch:
    """Keeps the offset between hand and robot.

    Args:
        button: which one disengages, from 0.
    """

    __slots__ = ("_button", "_held", "_held_turn", "_index", "_turn")

    def __init__(self, button: int) -> None:
        self._button = button
        self.reset()

    def reset(self) -> None:
        """Engage, without an offset between hand and robot."""
        self._index: Vector = ZERO
        self._held: Vector | None = None
        self._turn: Quaternion = IDENTITY
        self._held_turn: Quaternion | None = None

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
        self._device, self._frame, self._clutch, self._walls = device, frame, clutch, walls
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
        self._begin()

    def _begin(self) -> None:
        self._read: DeviceReading | None = None
        self._mapped: DeviceReading | None = None
        self._beyond: Vector = ZERO
        self._commanded_at: float | None = None
        self._gain, self._wall_gain = 1.0, 0.0

    @property
    def trouble(self) -> str | None:
        return getattr(self._device, "trouble", None)

    def open(self, now: float) -> None:
        self._begin()
        if self._clutch is not None:
            self._clutch.reset()
        self._device.open(now)

    def latest(self, now: float) -> DeviceReading:
        reading, last, clutch = self._device.latest(now), self._mapped, self._clutch
        if last is not None and reading == self._read:
            return last
        position = self._frame.position(reading.position)
        if clutch is not None:
            position = clutch.pass_through(position, reading.buttons, None if last is None else last.position)
        if self._walls is not None and is_finite(position):
            self._beyond = self._frame.way(self._walls.beyond(position))
            position = self._walls.inside(position)
        orientation = None
        if reading.orientation is not None:
            orientation = self._frame.orientation(reading.orientation)
            if clutch is not None:
                orientation = clutch.pass_orientation(orientation, None if last is None else last.orientation)
        self._read = reading
        self._mapped = mapped = reading._replace(position=position, orientation=orientation)
        return mapped

    def command(self, force: Vector, now: float) -> None:
        check_finite(self.spec.name, "force", force)
        elapsed = 0.0 if self._commanded_at is None else now - self._commanded_at
        self._commanded_at = now
        if elapsed > LONGEST_PAUSE:
            elapsed = self._gain = self._wall_gain = 0.0
        share = elapsed / self._ramp
        engaged = self._clutch is None or self._clutch.engaged
        self._gain = min(1.0, self._gain + share) if engaged else max(0.0, self._gain - share)
        on_hand = scale(self._frame.force(force), self._gain)
        if self._walls is not None:
            self._wall_gain = min(1.0, self._wall_gain + share)
            on_hand = add(on_hand, scale(self._walls.force(self._beyond), self._wall_gain))
        self._device.command(within(on_hand, self._limit), now)

    def turn(self, torque: Vector, now: float) -> None:
        """Fades with the clutch like the force of the last `command`; no effect on a device without torque."""
        check_finite(self.spec.name, "torque", torque)
        if self._turns is not None:
            self._turns.turn(scale(self._frame.torque(torque), self._gain), now)

    def close(self) -> None:
        self._device.close()
