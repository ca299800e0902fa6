"""One servo alone: positions and turns."""

from math import pi

from weberlink.slave.emulators.motor import OFF
from weberlink.slave.emulators.servo import Measured, Servo

TURN = 2.0 * pi


class Shaft:
    """What the servo's sensors give."""

    def __init__(self, angle: float) -> None:
        self.angle = angle

    def __call__(self) -> Measured:
        return Measured(self.angle, 0.0, 0.0)


def position(servo: Servo) -> int:
    error, data = servo.read(132, 4)
    assert error == 0
    return int.from_bytes(data, "little", signed=True)


def test_the_position_counts_on_over_turns_until_it_is_reset() -> None:
    shaft = Shaft(0.5 * TURN + 0.1)
    servo = Servo(1, shaft)
    assert position(servo) == 65  # within a turn after power
    shaft.angle += TURN
    assert position(servo) == 65 + 4096
    assert servo.write(64, b"\x01") == 0  # position control
    assert position(servo) == 65
    assert servo.write(64, b"\x00") == 0
    assert servo.write(11, b"\x00") == 0
    shaft.angle -= 2.0 * TURN
    assert servo.write(64, b"\x01") == 0  # current control: goes on counting
    assert position(servo) == 65 - 2 * 4096
    servo.reboot(0.0)
    assert position(servo) == 65
    assert servo.drive is OFF


def test_a_goal_is_within_the_turn_that_the_position_is_in() -> None:
    shaft = Shaft(TURN + 0.1)
    servo = Servo(1, shaft)
    assert servo.write(116, (2048).to_bytes(4, "little")) == 0
    assert servo.write(64, b"\x01") == 0
    assert abs(servo.drive.goal - TURN) < 1e-9
