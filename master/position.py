"""The position of the operator's hand as a channel."""

from collections.abc import Callable
from math import hypot, inf

from weberlink.control.contract import FREE_FORCE, LEAST_CONTACT
from weberlink.control.ends import MasterControl
from weberlink.geometry.joints import Joints
from weberlink.geometry.vector import ZERO, Vector
from weberlink.master.devices.contract import DeviceReading


class HandPosition:
    """The position of the device [m], and what is sent of it: the command of the control scheme.

    In contact, a position error e changes the robot's force by up to K e, with the stiffness K of the contact. So an
    error stays unsent only if K e is within the deadband of the displayed force, `force_bound` of its size [N]. No more
    than `free` [N] needs no contact.
    """

    def __init__(self, control: MasterControl, force_bound: Callable[[float], float], free: float = FREE_FORCE) -> None:
        self.value: Vector = ZERO
        self.command: Vector = ZERO
        """What was sampled last [m]."""
        self.displayed: Joints = ZERO
        """Force on the hand now [N], drag included."""
        self.touched: Joints = ZERO
        """Force of the contact as decoded [N]: in free motion, drag alone does not narrow the deadband."""
        self.asked = 0.0
        """Size of what the control scheme asks for [N]: no drag is larger than `free`, and a model that is felt before
        the robot touches must lead it there."""
        self.control = control
        self._force_bound = force_bound
        self._free = free

    def complaint(self, reading: DeviceReading) -> str | None:
        x, y, z = reading.position
        return None if x - x == y - y == z - z == 0.0 else f"reports the position {reading.position}"

    def take(self, reading: DeviceReading) -> None:
        self.value = reading.position

    def felt(self, decoded: Joints, output: Joints, asked: float) -> None:
        """Take in what is displayed of the force, as `Display` has it."""
        self.touched, self.displayed, self.asked = decoded, output, asked

    def sample(self) -> tuple[Vector, Vector, float]:
        control = self.control
        self.command = command = control.command(self.value)
        force = hypot(*self.displayed)
        touches = force > LEAST_CONTACT and (self.asked > self._free or hypot(*self.touched) > LEAST_CONTACT)
        most = self._force_bound(force) / control.stiffness if touches else inf
        return command, ZERO, most
