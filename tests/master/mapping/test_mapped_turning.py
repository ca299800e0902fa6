"""A mapped device that turns: what is sent of its orientation, what torque is felt, and the clutch."""

from dataclasses import replace
from math import radians

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.master.mapping.test_mapped_device import Handle as StillHandle
from weberlink.geometry.rotation import IDENTITY, Quaternion, angle_between, inverse, product, quaternion, vector
from weberlink.geometry.vector import ZERO, Vector, scale
from weberlink.master.devices.contract import DeviceReading, TorqueDevice
from weberlink.master.mapping import Clutch, FrameMap, MappedDevice

TICK = 0.001
SAME = FrameMap((0.0, 0.0, 0.0), 1.0, 1.0, ZERO)
turns = st.tuples(*[st.floats(-1.0, 1.0)] * 3)


class Handle(StillHandle):
    """A device that is as a test turns it, and feels torque."""

    def __init__(self, torque_n_m: float = 0.4) -> None:
        super().__init__(replace(StillHandle().spec, orientation=True, torque_n_m=torque_n_m))
        self.orientation: Quaternion = IDENTITY

    def latest(self, now: float) -> DeviceReading:
        return DeviceReading(now, ZERO, orientation=self.orientation, buttons=self.buttons)

    def command(self, force: Vector, now: float) -> None:
        pass

    def turn(self, torque: Vector, now: float) -> None:
        self.felt = torque


class Hands:
    """A mapped handle, turned and told tick by tick."""

    def __init__(self, frame: FrameMap = SAME, *, clutch: bool = False, torque_n_m: float = 0.4) -> None:
        self.handle = Handle(torque_n_m)
        self.device = MappedDevice(
            self.handle, frame, clutch=Clutch(1) if clutch else None, walls=None, force_limit=10.0, ramp=0.05
        )
        self.now = 0.0
        self.device.open(0.0)

    def tick(self, turn: Vector, torque: Vector = ZERO, *, pressed: bool = False, count: int = 1) -> Quaternion:
        """What is sent, at the last of `count` ticks."""
        self.handle.orientation = quaternion(turn)
        self.handle.buttons = 2 if pressed else 0
        for _ in range(count):
            self.now += TICK
            reading = self.device.latest(self.now)
            self.device.command(ZERO, self.now)
            self.device.turn(torque, self.now)
        assert reading.orientation is not None
        return reading.orientation


def test_rotation_torque_and_spec_are_in_robot_frame() -> None:
    """A quarter turn about z between the frames: the hand's x is the robot's y. Motion is scaled, angles are not."""
    hands = Hands(FrameMap((0.0, 0.0, 90.0), 0.1, 0.5, (0.0, 0.0, 0.1)))
    assert isinstance(hands.device, TorqueDevice)
    assert hands.device.spec.orientation
    assert hands.device.spec.torque_n_m == 0.8, "0.4 N m in the hand"
    assert vector(hands.tick((0.3, 0.0, 0.2), (0.0, 0.6, 0.1))) == pytest.approx((0.0, 0.3, 0.2))
    assert hands.handle.felt == pytest.approx((0.3, 0.0, 0.05))


def test_held_clutch_keeps_the_tool_orientation() -> None:
    hands = Hands(clutch=True)
    before = hands.tick((0.5, 0.0, 0.0))
    assert hands.tick((0.2, 0.3, 0.0), pressed=True) == before
    assert hands.tick((0.0, 0.0, -0.4), pressed=True) == before
    assert angle_between(hands.tick((0.0, 0.0, -0.4)), before) < 1e-12
    on = hands.tick((0.0, 0.0, -0.3))
    assert vector(product(on, inverse(before))) == pytest.approx((0.0, 0.0, 0.1)), "about z, as the hand turned"


@given(st.lists(st.tuples(st.booleans(), turns), min_size=1, max_size=40))
def test_indexing_never_jumps(script: list[tuple[bool, Vector]]) -> None:
    """What is sent turns no further than the hand does, whatever is pressed."""
    hands = Hands(clutch=True)
    before, hand = hands.tick(ZERO), IDENTITY
    for pressed, turn in script:
        sent = hands.tick(turn, pressed=pressed)
        assert angle_between(before, sent) <= angle_between(hand, quaternion(turn)) + 1e-7
        before, hand = sent, quaternion(turn)


def test_device_without_torque_gets_none() -> None:
    hands = Hands(torque_n_m=0.0)
    hands.tick(ZERO, scale((0.0, 0.0, 1.0), radians(10.0)), count=100)
    assert hands.handle.felt == ZERO
    assert hands.device.spec.torque_n_m == 0.0
