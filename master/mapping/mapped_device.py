"""A haptic device in the frame of the robot: rotation, scale, offset, clutch and virtual walls.

Everything outside this package uses the robot's frame. `MappedDevice` implements the device contract, so the loop does
not depend on the map.
"""

from dataclasses import replace
from math import cos, radians, sin
from typing import NamedTuple

from weberlink.geometry.rotation import IDENTITY, Quaternion, inverse, product
from weberlink.geometry.vector import ZERO, Vector, add, confined, dot, is_finite, scale, subtract, within
from weberlink.master.devices.contract import Device, DeviceReading, DeviceSpec, TorqueDevice, check_finite

Box = tuple[Vector, Vector]  # lowest and highest corner
LONGEST_PAUSE = 0.1  # after a longer pause between two commands [s], walls and force fade in again


class FrameMap:
    """robot = offset + motion_scale R device; forces go the other way by the transpose.

    A turn of the handle about an axis a is the same turn of the robot's tool about R a: angles are not scaled, and a
    handle level with its device is a tool level with the robot. Torques go the other way by the transpose and by the
    scale of force alone, so that a tool feels alike in its force and in its torque. The power of turning is then scaled
    by force_scale and that of moving by force_scale / motion_scale: one and the same factor with a motion_scale of 1.

    `rotation_deg` turns about the fixed x, y and z axes of the robot, in this order (R = Rz Ry Rx); both scales are >
    0.
    """

    def __init__(self, rotation_deg: Vector, motion_scale: float, force_scale: float, offset: Vector) -> None:
        (cx, sx), (cy, sy), (cz, sz) = (_cos_sin(angle) for angle in rotation_deg)
        a = (cz * cy, cz * sy * sx - sz * cx, cz * sy * cx + sz * sx)
        b = (sz * cy, sz * sy * sx + cz * cx, sz * sy * cx - cz * sx)
        c = (-sy, cy * sx, cy * cx)
        self._rows = (a, b, c)
        self._columns = ((a[0], b[0], c[0]), (a[1], b[1], c[1]), (a[2], b[2], c[2]))
        (cx, sx), (cy, sy), (cz, sz) = (_cos_sin(angle / 2.0) for angle in rotation_deg)
        self._quaternion = product((cz, 0.0, 0.0, sz), product((cy, 0.0, sy, 0.0), (cx, sx, 0.0, 0.0)))
        self.motion_scale = motion_scale
        self.force_scale = force_scale
        self._offset = offset

    def position(self, device: Vector) -> Vector:
        """Position of the robot [m] for a position of the device [m]."""
        return add(self._offset, scale(_times(self._rows, device), self.motion_scale))

    def way(self, robot: Vector) -> Vector:
        """Displacement of the hand [m] for a displacement of the robot [m]."""
        return scale(_times(self._columns, robot), 1.0 / self.motion_scale)

    def force(self, robot: Vector) -> Vector:
        """Force on the hand [N] for a force on the robot [N]; torque on it [N m] for a torque about the tool's tip."""
        return scale(_times(self._columns, robot), self.force_scale)

    def orientation(self, device: Quaternion) -> Quaternion:
        """Orientation of the tool in the robot's frame for that of the handle in the device's."""
        return product(self._quaternion, product(device, inverse(self._quaternion)))

    def box(self, device: Box) -> Box:
        """The smallest box along the robot's axes that holds a box of the device [m]."""
        low, high = device
        corners = [
            self.position((x, y, z)) for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])
        ]
        x, y, z = zip(*corners, strict=True)
        return (min(x), min(y), min(z)), (max(x), max(y), max(z))

    def axes(self, device: str) -> str:
        """The axes of the robot that a device with these axes can move."""
        columns = ["xyz".index(axis) for axis in device]
        return "".join(
            axis
            for axis, row in zip("xyz", self._rows, strict=True)
            if any(abs(row[column]) > 1e-9 for column in columns)
        )


def _cos_sin(degrees: float) -> tuple[float, float]:
    """Exact at multiples of a right angle."""
    quarter, rest = divmod(degrees, 90.0)
    if rest == 0.0:
        return ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))[int(quarter) % 4]
    return cos(radians(degrees)), sin(radians(degrees))


def _times(rows: tuple[Vector, Vector, Vector], v: Vector) -> Vector:
    a, b, c = rows
    return (dot(a, v), dot(b, v), dot(c, v))


class Walls(NamedTuple):
    """A box in the robot's frame [m]: sent positions stay inside, and a hand beyond is pushed back, by a stiffness
    [N/m].
    """

    box: Box
    stiffness: float


class Clutch:
    """Keeps the offset between hand and robot. `button`: which one disengages, from 0."""

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

    def pass_through(
        self, position: Vector, orientation: Quaternion | None, buttons: int, last: DeviceReading | None
    ) -> tuple[Vector, Quaternion | None]:
        """The pose for the robot, given that of the hand, mapped, without any indexing [m].

        `last` was that of the robot, and what it stays at while disengaged; None before the first reading, which
        engages whatever is pressed.
        """
        if buttons >> self._button & 1 and last is not None:
            if self._held is None:
                self._held = last.position
            if orientation is None:
                return self._held, None
            if self._held_turn is None:
                self._held_turn = last.orientation or orientation
            return self._held, self._held_turn
        if self._held is not None:
            self._index, self._held = subtract(self._held, position), None
        if orientation is not None:
            if self._held_turn is not None:
                # On the right, so that a turn of the hand about an axis stays one of the tool about the same axis.
                self._turn, self._held_turn = product(inverse(orientation), self._held_turn), None
            if self._turn != IDENTITY:
                orientation = product(orientation, self._turn)
        return add(position, self._index), orientation


class MappedDevice:
    """Maps the readings and the commands of another device.

    The force of the robot fades out while the clutch is held, and in again after it. The walls fade in after `open`, so
    that they do not hit a hand that starts beyond one; they act without a peer too. A fade takes `ramp` [s]. The sum
    never exceeds `force_limit` [N].
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
        position, orientation = self._frame.position(reading.position), reading.orientation
        if orientation is not None:
            orientation = self._frame.orientation(orientation)
        if clutch is not None:
            position, orientation = clutch.pass_through(position, orientation, reading.buttons, last)
        if self._walls is not None and is_finite(position):
            inside = confined(position, self._walls.box)
            self._beyond = self._frame.way(subtract(position, inside))
            position = inside
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
            on_hand = add(on_hand, scale(self._beyond, -self._walls.stiffness * self._wall_gain))
        self._device.command(within(on_hand, self._limit), now)

    def turn(self, torque: Vector, now: float) -> None:
        """Fades with the clutch like the force of the last `command`; no effect on a device without torque."""
        check_finite(self.spec.name, "torque", torque)
        if self._turns is not None:
            self._turns.turn(scale(self._frame.force(torque), self._gain), now)

    def close(self) -> None:
        self._device.close()
