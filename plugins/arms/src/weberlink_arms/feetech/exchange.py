"""What one cycle on the bus of an SO-101 does, for a leader as for a follower."""

from collections.abc import Callable
from contextlib import suppress
from time import monotonic, sleep

from weberlink.hardware.fault import HardwareFault
from weberlink.hardware.pace import check_pace
from weberlink_arms.feetech.arm import NAMES, AngleScale, So101Options, angle_scale, check_place
from weberlink_arms.feetech.bus import ServoBus, ServoPort
from weberlink_arms.feetech.registers import Present
from weberlink_arms.feetech.servos import Servos, torque_off


class So101Bus:
    """The open bus of an arm.

    Args:
        options: Of the arm.
        port: Open; closed with this.
        clock: Monotonic [s].
        pause: Sleeps [s].

    Raises:
        HardwareFault: the arm cannot be used; the port is left open.
    """

    def __init__(
        self,
        options: So101Options,
        port: ServoPort,
        clock: Callable[[], float] = monotonic,
        pause: Callable[[float], None] = sleep,
    ) -> None:
        self._options = options
        self._port = port
        self._clock = clock
        self.bus = ServoBus(port, options.baud, options.ids, NAMES, options.margin_s, clock, pause)
        self.servos = Servos(self.bus, options.baud)
        self.servos.find()
        self.scale: AngleScale = angle_scale(options, self.servos.ranges())
        check_place(NAMES, self.scale.angles(self.first()), options.lower_rad, options.upper_rad)

    def first(self) -> list[Present]:
        """Measurements of all, tried again after a bad answer; raises as the bus does."""
        return self.servos.insist(self.bus.exchange)

    def check_pace(self) -> None:
        """Raise HardwareFault if the rate cannot be held."""
        advice = "set rate_hz lower, or use another USB port or host"
        check_pace(self.first, self._options.rate_hz, self._clock, self._port.path, lambda: advice)

    def release(self) -> None:
        """Take the torque off, and set the servos back to their own gain and limit; never raises."""
        with suppress(HardwareFault):
            self.bus.send(torque_off(self._options.ids))
        self.servos.restore()

    def close(self) -> None:
        self._port.close()
