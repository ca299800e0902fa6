"""The port of a leader arm: what it displays of several channels, and when it displays nothing."""

from math import inf, nan
from typing import Any

import pytest

from tests.arms.ends import TICK, Hand, Transparent, link, spec
from tests.compiled import replaces_methods
from weberlink.arms.contract import ArmFault
from weberlink.arms.sensor import sensors_of
from weberlink.geometry.joints import Joints
from weberlink.master.gate import PATIENCE, Bound, ContactLimiter, ContactWatch, OutputGate
from weberlink.master.operator_port import Display, OperatorPort

pytestmark = replaces_methods  # `link` stands in for an endpoint, a compiled class
MOST = (1.0, 0.8, 0.5)
SLEW = (50.0, 50.0, 20.0)
RAMP, SILENCE = 0.05, 0.1
FREE, RTT = 0.2, 0.1
ANGLES = (0.1, -0.2, 0.3)


class Leading:
    """A leader port in virtual time; with a `delay` [s], torques end on each channel for which nothing is stated."""

    def __init__(self, *, gripper: bool = True, delay: float | None = None) -> None:
        self.hand = Hand(spec(gripper=gripper))
        self.hand.angles = ANGLES[: self.hand.spec.axes]
        self.control, self.link = Transparent(), link()
        self.link.clock.rtt = RTT
        self.sensors, bounds = sensors_of(self.hand.spec, "angles"), []
        for sensor in self.sensors:
            most, watch = sensor.part(MOST), None
            if delay is not None:
                watch = ContactWatch(ContactLimiter(max(most), FREE, 1.0), self.link, (0.02,) * len(most), delay)
            bounds.append(Bound(most, sensor.part(SLEW), RAMP, width=1, contact=watch))
        control: Any = self.control
        display = Display(control, self.sensors, self.hand.command)
        gate = OutputGate(bounds, ramp=RAMP, silence=SILENCE, fade_share=0.8)
        self.port = OperatorPort(self.hand, displays=[display], endpoint=self.link, gate=gate, fault=ArmFault)
        self.now = 0.0

    def tick(self, *values: Joints | None) -> Joints:
        """A tick; returns the torques displayed in it."""
        self.now += TICK
        self.link.liveness.in_touch_at = self.now
        for sensor in self.sensors:
            sensor.take(self.port.latest(self.now))
        self.port.account(TICK, 0.0, encodes=True)
        self.port.actuate(values, self.now, TICK, TICK, engaged=True)
        return self.port.displays[0].output

    def opened(self, *values: Joints | None) -> Joints:
        """The torques once the gate is open."""
        shown = [self.tick(*values) for _ in range(round(2 * RAMP / TICK))]
        assert self.port.gate.gain == 1.0
        return shown[-1]


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
    leading = Leading(gripper=len(values) == 2)
    assert leading.opened(*values) == leading.hand.felt[-1] == shown
    assert leading.control.told[0][0] == leading.hand.angles, "of whose motion they do work"
    assert leading.control.told[-1] == ("displayed", shown)
    assert leading.port.gate.clipped == (sum(values, ()) != shown)


@pytest.mark.parametrize("nothing", [None, (nan, 0.0), (0.0, -inf)])
def test_a_channel_of_which_nothing_of_use_is_decoded_displays_none(nothing: Joints | None) -> None:
    leading = Leading()
    leading.opened((0.5, 0.1), (0.3,))
    assert leading.opened(nothing, (0.3,)) == leading.port.displays[0].decoded == (0.0, 0.0, 0.3)
    assert leading.opened((0.5, 0.1), None) == (0.5, 0.1, 0.0)


@pytest.mark.parametrize("delay", [0.0, 0.05])
def test_torque_without_a_contact_ends_on_the_channel_that_has_none(delay: float) -> None:
    """What the gripper holds founds no torque of the joints."""
    leading = Leading(delay=delay)
    leading.opened((0.0, 0.0), (0.0,))
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
