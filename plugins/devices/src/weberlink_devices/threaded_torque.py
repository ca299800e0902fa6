"""A blocking device that displays force and torque behind the non-blocking `TorqueDevice` contract."""

from math import inf
from typing import Any, NamedTuple

from weberlink.geometry.vector import ZERO, Vector, scale, within
from weberlink.hardware.worker import Exchange
from weberlink.master.devices.contract import DeviceReading, DeviceSpec, check_finite
from weberlink.master.devices.hardware_device import ThreadedDevice


class Wrench(NamedTuple):
    """Force [N] and torque [N m] on the hand."""

    force: Vector = ZERO
    torque: Vector = ZERO

    def scaled(self, factor: float) -> "Wrench":
        return Wrench(scale(self.force, factor), scale(self.torque, factor))


NO_WRENCH = Wrench()


class ThreadedTorqueDevice(ThreadedDevice):
    """A device that displays force and torque, as one command of type `Wrench`; arguments as of `ThreadedDevice`.

    `command` starts the exchange, with the torque of the last `turn`: a loop that turns after it commands is one tick
    late with the torque. A torque ends as a force does when no new one comes.
    """

    def __init__(
        self, spec: DeviceSpec, exchange: Exchange[Wrench, DeviceReading], tick_period: float, **others: Any
    ) -> None:
        super().__init__(spec, exchange, tick_period, rest=NO_WRENCH, share=Wrench.scaled, **others)
        self._torque: tuple[Vector, float] = (ZERO, -inf)
        """The last one, and its time."""

    def open(self, now: float) -> None:
        self._torque = (ZERO, -inf)
        super().open(now)

    def command(self, force: Vector, now: float) -> None:
        torque, at = self._torque
        self._worker.command(Wrench(self._displayable(force), torque if now - at <= self._stale else ZERO), now)

    def turn(self, torque: Vector, now: float) -> None:
        check_finite(self.spec.name, "torque", torque)
        self._torque = (within(torque, self.spec.torque_n_m), now)
