"""The port of a leader arm: what it sends, what it displays, and when it displays nothing."""

from collections.abc import Sequence
from math import inf, nan
from typing import Any

import pytest

from tests.arms.ends import TICK, Hand, Transparent, link, spec
from tests.compiled import replaces_methods
from weberlink.arms.contract import ArmFault
from weberlink.arms.sensor import PressedAxes, sensors_of
from weberlink.geometry.joints import Joints
from weberlink.master.gate import PATIENCE, Bound, ContactLimiter, ContactWatch, OutputGate
from weberlink.master.operator_port import Display, OperatorPort

pytestmark = replaces_methods  # `link` stands in for an endpoint, a compiled class
MOST = (1.0, 0.8, 0.5)
SLEW = (50.0, 50.0, 20.0)
RAMP, SILENCE = 0.05, 0.1
FREE, RTT = 0.2, 0.1


class Leading:
    """A leader port in virtual time."""

    def __init__(
        self,
        hand: Hand | None = None,
        most: Joints = MOST,
        contacts: Sequence[ContactLimiter] = (),
        pressed: Sequence[PressedAxes | None] = (),
        delay: float = 0.0,
    ) -> None:
        self.hand = hand or Hand()
        self.control, self.link = Transparent(), link()
        spec = self.hand.spec
        self.sensors, bounds = sensors_of(spec, "angles"), []
        for index, sensor in enumerate(self.sensors):
            limits, slew, least = sensor.part(most), sensor.part(SLEW), sensor.part((0.02, 0.02, 0.02))
            watch = ContactWatch(contacts[index], self.link, least, delay) if contacts else None
            bounds.append(Bound(limits, slew, RAMP, width=1, contact=watch))
        for sensor, axes in zip(self.sensors, pressed, strict=False):
            sensor.pressed = axes
        control: Any = self.control
        display = Display(control, self.sensors, self.hand.command)
        for sensor in self.sensors:
            sensor.felt = display
        gate = OutputGate(bounds, ramp=RAMP, silence=SILENCE, fade_share=0.8)
        self.port = OperatorPort(self.hand, displays=[display], endpoint=self.link, gate=gate, fault=ArmFault)
        self.now = 0.0
        self.port.open(0.0)

    def sense(self) -> None:
        reading = self.port.latest(self.now)
        for sensor in self.sensors:
            assert sensor.complaint(reading) is None
            sensor.take(reading)
        self.port.accept(reading)
        self.port.account(TICK, 0.0, encodes=True)

    def tick(self, *values: Joints | None) -> Joints:
        """A tick; returns the torques displayed in it."""
        self.now += TICK
        self.link.liveness.in_touch_at = self.now
        self.sense()
        self.port.actuate(values, self.now, TICK, TICK, engaged=True)
        return self.output

    @property
    def output(self) -> Joints:
        return self.port.displays[0].output

    def opened(self, *values: Joints | None) -> "Leading":
        for _ in range(round(2 * RAMP / TICK)):
            self.tick(*values)
        assert self.port.gate.gain == 1.0
        return self


@pytest.mark.parametrize(
    ("torques", "most"),
    [
        ((0.0, 0.0), inf),
        ((0.05, -0.05), inf),  # no more than its own deadband
        ((0.5, 0.0), 0.05 / (0.01 * 10.0)),
        ((-0.6, 0.0), 0.06 / (0.01 * 10.0)),
        ((-0.6, 0.8), 0.08 / (0.02 * 50.0)),
    ],
)
def test_where_a_torque_is_pressed_angles_are_sent_as_finely_as_it_is_felt(torques: Joints, most: float) -> None:
    pressed = PressedAxes((0.01, 0.02), (10.0, 50.0), lambda _, torque: max(0.1 * torque, 0.05))
    leading = Leading(pressed=[pressed, None])
    leading.tick(torques, (0.5,))
    leading.sense()
    assert leading.sensors[0].sample()[2] == pytest.approx(most)
    assert leading.sensors[1].sample()[2] == inf


@pytest.mark.parametrize(
    ("values", "shown"),
    [
        (((0.2, -0.3), (0.1,)), (0.2, -0.3, 0.1)),
        (((5.0, 0.1), (0.2,)), (1.0, 0.1, 0.2)),  # each axis is limited alone
        (((1.0, -0.9), (-0.6,)), (1.0, -0.8, -0.5)),
        (((0.2, -0.3),), (0.2, -0.3)),  # an arm without a gripper has one channel
    ],
)
def test_torques_of_all_channels_reach_their_axes_within_their_limits(
    values: tuple[Joints, ...], shown: Joints
) -> None:
    short = spec(gripper=False, lower=(-1.0, -1.0), upper=(1.0, 1.0), torque_nm=(1.0, 1.0))
    leading = Leading(Hand(short), most=(1.0, 1.0)) if len(values) == 1 else Leading()
    leading.opened(*values)
    assert leading.hand.felt[-1] == leading.output == shown
    assert leading.control.told[-1] == ("displayed", shown)
    assert leading.port.gate.clipped == (sum(values, ()) != shown)


@pytest.mark.parametrize("nothing", [None, (nan, 0.0), (0.0, -inf)])
def test_a_channel_of_which_nothing_of_use_is_decoded_displays_none(nothing: Joints | None) -> None:
    leading = Leading().opened((0.5, 0.1), (0.3,))
    for _ in range(60):
        leading.tick(nothing, (0.3,))
    assert leading.port.displays[0].decoded == leading.output == (0.0, 0.0, 0.3)
    assert set(leading.opened((0.5, 0.1), None).output[2:]) == {0.0}


def founded(delay: float = 0.0) -> Leading:
    """A leader whose torques end where the follower states none: of the joints, and of the gripper."""
    leading = Leading(contacts=[ContactLimiter(1.0, FREE, 1.0), ContactLimiter(0.5, FREE, 1.0)], delay=delay)
    leading.link.clock.rtt = RTT
    return leading.opened((0.0, 0.0), (0.0,))


@pytest.mark.parametrize("delay", [0.0, 0.05])
def test_torque_without_a_contact_ends_on_the_channel_that_has_none(delay: float) -> None:
    """What the gripper holds founds no torque of the joints."""
    leading = founded(delay)
    leading.control.answer = (0.6, 0.1, 0.4)
    answer = round((RTT + delay + PATIENCE) / TICK)
    shown = [leading.tick((0.02, -0.02), (0.3,)) for _ in range(1000)]  # the least that states one, and no more
    assert max(abs(torques[0]) for torques in shown[answer:]) <= FREE * (1 + 1e-9)
    assert shown[answer - 1][:2] == pytest.approx((FREE, FREE / 6.0), rel=0.05), "both as much shorter"
    assert {torques[2] for torques in shown[100:]} == {0.4}
    assert shown[-1][:2] == (0.0, 0.0)
    assert leading.port.unfounded
    assert leading.control.resumed == 1
    assert leading.tick((0.0, 0.05), (0.3,))[0] < 0.1, "any axis states one"
    assert not leading.port.unfounded
