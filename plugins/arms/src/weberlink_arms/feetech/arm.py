"""The SO-101: its axes, the options of its bus, and its cycle."""

from math import pi
from typing import Annotated, ClassVar, Final

from pydantic import Field

from weberlink.hardware.fault import HardwareFault
from weberlink_arms.feetech.bus import FeetechBus, FeetechServos
from weberlink_arms.feetech.packet import HIGHEST_ID
from weberlink_arms.feetech.registers import BAUD_RATES, ORDER_SIZE
from weberlink_arms.servo.exchange import Command, Sample, ServoExchange
from weberlink_arms.servo.layout import COUNTS_PER_TURN, LEROBOT_JOINTS, ArmLayout
from weberlink_arms.servo.options import AngleScale, ServoOptions

Six = tuple[float, float, float, float, float, float]
Positive = Annotated[float, Field(gt=0.0, le=100.0)]
SixPositive = tuple[Positive, Positive, Positive, Positive, Positive, Positive]

SO101: Final = ArmLayout(
    name="so101",
    title="an SO-101",
    joints=LEROBOT_JOINTS,
    ids=(1, 2, 3, 4, 5, 6),
    lower=(-1.91986, -1.74533, -1.69, -1.65806, -2.74385, 0.0),
    upper=(1.91986, 1.74533, 1.69, 1.65806, 2.84121, 1.91986),
    sign=(1,) * 6,
    offset_rad=(0.0,) * 6,
)
"""Ranges of TheRobotStudio/SO-ARM100, so101_new_calib.xml, whose zeros are the middles of the ranges as LeRobot's
calibration sets them; the gripper there goes from -0.174533 (closed) to 1.74533."""
NO_LOAD_RAD_S: Final = 45.0 * 2.0 * pi / 60.0  # speed of the 1/345 servo at its rated voltage, by the vendor
# Requests in the guardian's message; together longer than a message that it may cut, so that one arrives whole.
REPEATS: Final = 6


class So101Options(ServoOptions):
    """Options that leader and follower share. Lists: shoulder_pan, shoulder_lift, elbow_flex, wrist_flex, wrist_roll,
    gripper."""

    LAYOUT: ClassVar[ArmLayout] = SO101
    BUS = FeetechBus
    BAUD_RATES = BAUD_RATES
    HIGHEST_ID = HIGHEST_ID
    SLOWEST_HZ = 20.0
    GOAL_SIZE = ORDER_SIZE
    HOST_S = 0.0005
    LOST_S = 0.25

    rate_hz: float = Field(default=200.0, ge=20.0, le=400.0, description="of the bus")
    gripper_closed: int | None = Field(
        default=None,
        ge=0,
        le=4095,
        description="position of the gripper's servo where it is closed; by LeRobot's calibration if not given",
    )
    torque_per_load_nm: SixPositive | None = Field(
        default=None, description="torque of a load of 0.1 %, by a calibration; by the data sheet if not given"
    )
    rated_v: float = Field(
        default=7.4, ge=4.0, le=14.0, description="supply at which the torques of the data sheet or calibration hold"
    )


class FeetechExchange(ServoExchange[Command, Sample]):
    """Of an SO-101."""

    ZERO_ADVICE = "calibrate the arm with lerobot-calibrate, or check ids, sign and offset_rad"

    def _made(self, bus: FeetechBus) -> FeetechServos:
        return FeetechServos(bus)

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

    def _prepare(self) -> None:
        self._servos.prepare(self._options.p_gain)

    def _advice(self) -> str:
        return "set rate_hz lower, or use another USB port or host"
