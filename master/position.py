"""The position of the operator's hand as a channel."""

from collections.abc import Callable
from math import hypot, inf
from typing import Any

from weberlink.control.contract import FREE_FORCE, LEAST_CONTACT
from weberlink.control.ends import MasterControl
from weberlink.geometry.vector import ZERO, Vector
from weberlink.master.devices.contract import DeviceReading


class HandPosition:
    """The position of the device [m], and what is sent of it: the command of the control scheme.

    In contact, a position error e changes the robot's force by up to K e, with the stiffness K of the contact. So an
    error stays unsent only if K e is within the deadband of the displayed force, `force_bound` of its size [N]. No more
    than `free` [N] needs no contact.
    """

    def __init__(self, control: MasterControl, force_bound: Callable[[float], float], free: float = FREE_FORCE) -> None:
        self.value = self.way = ZERO
        self.command: Vector = ZERO  # what was sampled last [m]
        self.felt: Any = None  # the `weberlink.master.operator_port.Display` of the force
        self.control = control
        self._force_bound = force_bound
        self._free = free

    def complaint(self, reading: DeviceReading) -> str | None:
        x, y, z = reading.position
        return None if x - x == y - y == z - z == 0.0 else f"reports the position {reading.position}"

    def take(self, reading: DeviceReading) -> None:
        self.value = self.way = reading.position

    def sample(self) -> tuple[Vector, Vector, float]:
        control = self.control
        self.command = command = control.command(self.value)
        felt = self.felt
        force = hypot(*felt.output)
        # No drag is larger than `free`, and in free motion it alone does not narrow the deadband; but a model that is
        # felt before the robot touches must lead it there.
        touches = force > LEAST_CONTACT and (felt.asked > self._free or hypot(*felt.decoded) > LEAST_CONTACT)
        most = self._force_bound(force) / control.stiffness if touches else inf
        return command, ZERO, most
