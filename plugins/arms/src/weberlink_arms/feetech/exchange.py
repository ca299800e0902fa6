"""What one cycle on the bus of an SO-101 does, for a leader as for a follower."""

from weberlink.hardware.fault import HardwareFault
from weberlink_arms.feetech.bus import FeetechBus
from weberlink_arms.feetech.registers import COUNTS_PER_TURN, Present
from weberlink_arms.feetech.servos import FeetechServos
from weberlink_arms.servo.bus import ServoPort
from weberlink_arms.servo.exchange import Command, Sample, ServoExchange
from weberlink_arms.servo.options import AngleScale


class FeetechExchange(ServoExchange[Command, Sample]):
    """Of an SO-101."""

    ZERO_ADVICE = "calibrate the arm with lerobot-calibrate, or check ids, sign and offset_rad"

    def _made(self, port: ServoPort) -> FeetechServos:
        options = self._options
        return FeetechServos(
            FeetechBus(
                port, options.baud, options.bus_ids, options.LAYOUT.axes, options.margin_s, self._clock, self._pause
            )
        )

    def _scaled(self, servos: FeetechServos) -> AngleScale:
        """With the closed gripper of the option or of LeRobot's calibration, which its range holds."""
        options, scale = self._options, self._options.scale
        closed = options.gripper_closed
        if closed is None:
            low, high = servos.ranges()[-1]
            if (low, high) == (0, COUNTS_PER_TURN - 1):
                raise HardwareFault(
                    "gripper: its range is not calibrated; calibrate the arm with lerobot-calibrate, or give "
                    "gripper_closed"
                )
            closed = low if options.signs[-1] > 0 else high
        return AngleScale(scale.signs, (*scale.zeros[:-1], closed))

    def _measured(self) -> list[Present]:
        measured: list[Present] = self._servos.bus.exchange()
        return measured

    def _prepare(self) -> None:
        self._servos.prepare(self._options.p_gain)

    def _advice(self) -> str:
        return "set rate_hz lower, or use another USB port or host"
