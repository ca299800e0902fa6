"""A handle that is where a test puts it, and takes down what is on the hand."""

from weberlink.geometry.rotation import IDENTITY
from weberlink.geometry.vector import ZERO, Vector, cube
from weberlink.master.devices.contract import DeviceReading, DeviceSpec


class Handle:
    def __init__(self, force_n: float = 8.0, torque_n_m: float = 0.4) -> None:
        self.spec = DeviceSpec(
            "handle", "xyz", force_n, 2000.0, cube(0.06), 1000.0, force_feedback=True, buttons=2, orientation=True,
            torque_n_m=torque_n_m,
        )  # fmt: skip
        self.reading = DeviceReading(0.0, ZERO, orientation=IDENTITY)
        self.forces: list[Vector] = []
        self.torques: list[Vector] = []
        self.is_open = False

    def open(self, now: float) -> None:
        self.is_open = True

    def latest(self, now: float) -> DeviceReading:
        return self.reading

    def command(self, force: Vector, now: float) -> None:
        self.forces.append(force)

    def turn(self, torque: Vector, now: float) -> None:
        self.torques.append(torque)

    def close(self) -> None:
        self.is_open = False
