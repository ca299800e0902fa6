"""A mapped device: what is sent, what is felt, indexing and walls."""

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from weberlink.geometry.vector import ZERO, Vector, norm
from weberlink.master.devices.contract import DeviceReading, DeviceSpec
from weberlink.master.mapping import Clutch, FrameMap, MappedDevice, Walls

TICK = 0.001
EDGE = 0.06
BOX = ((-0.05, -0.05, -0.05), (0.05, 0.05, 0.05))
SAME = FrameMap((0.0, 0.0, 0.0), 1.0, 1.0, ZERO)


class Handle:
    """A device that is where a test puts it."""

    def __init__(self, spec: DeviceSpec | None = None) -> None:
        corner = (EDGE, EDGE, EDGE)
        self.spec = spec or DeviceSpec(
            "handle", "xyz", 8.0, 2000.0, ((-EDGE, -EDGE, -EDGE), corner), 1000.0, True, buttons=2
        )
        self.position: Vector = ZERO
        self.buttons = 0
        self.felt: Vector = ZERO
        self.is_open = False

    def open(self, now: float) -> None:
        self.is_open = True

    def latest(self, now: float) -> DeviceReading:
        return DeviceReading(now, self.position, orientation=(1.0, 0.0, 0.0, 0.0), buttons=self.buttons)

    def command(self, force: Vector, now: float) -> None:
        self.felt = force

    def close(self) -> None:
        self.is_open = False
        self.felt = ZERO


class Hands:
    """A mapped handle, moved and told tick by tick."""

    def __init__(
        self, frame: FrameMap = SAME, *, clutch: bool = False, walls: float | None = None, limit: float = 10.0
    ):
        self.handle = Handle()
        wall = None if walls is None else Walls(BOX, walls)
        self.device = MappedDevice(
            self.handle, frame, clutch=Clutch(1) if clutch else None, walls=wall, force_limit=limit, ramp=0.05
        )
        self.now = 0.0
        self.device.open(0.0)

    def tick(self, position: Vector, force: Vector = ZERO, *, pressed: bool = False, count: int = 1) -> Vector:
        """What is sent, at the last of `count` ticks."""
        self.handle.position = position
        self.handle.buttons = 2 if pressed else 0
        for _ in range(count):
            self.now += TICK
            reading = self.device.latest(self.now)
            self.device.command(force, self.now)
        return reading.position


def test_motion_force_and_spec_are_in_robot_frame() -> None:
    hands = Hands(FrameMap((0.0, 0.0, 90.0), 2.0, 0.5, (0.0, 0.0, 0.1)))
    assert hands.tick((0.01, 0.0, 0.0), (0.0, 3.0, 0.0)) == pytest.approx((0.0, 0.02, 0.1))
    assert hands.handle.felt == pytest.approx((1.5, 0.0, 0.0))
    spec = hands.device.spec
    assert spec.force_n == 16.0, "8 N in the hand"
    assert spec.stiffness_n_m == 2000.0
    assert spec.workspace_m[0] == pytest.approx((-0.12, -0.12, -0.02))
    assert spec.workspace_m[1] == pytest.approx((0.12, 0.12, 0.22))


def test_the_limit_is_that_of_the_hand() -> None:
    hands = Hands(FrameMap((0.0, 0.0, 0.0), 1.0, 4.0, ZERO), limit=6.0)
    hands.tick(ZERO, (0.0, 100.0, 0.0))
    assert norm(hands.handle.felt) == pytest.approx(6.0)
    assert hands.device.spec.force_n == 1.5


def test_held_clutch_keeps_the_robot_position() -> None:
    hands = Hands(clutch=True, walls=500.0)
    assert hands.tick((0.02, 0.0, 0.0)) == (0.02, 0.0, 0.0)
    assert hands.tick((0.01, 0.01, 0.0), pressed=True) == (0.02, 0.0, 0.0)
    assert hands.tick((-0.02, 0.03, 0.0), pressed=True) == (0.02, 0.0, 0.0)
    assert hands.tick((-0.02, 0.03, 0.0)) == pytest.approx((0.02, 0.0, 0.0))
    assert hands.tick((-0.01, 0.03, 0.0)) == pytest.approx((0.03, 0.0, 0.0))


def test_force_fades_with_the_clutch_without_jumps() -> None:
    hands = Hands(clutch=True, walls=500.0)
    force = (0.0, 0.0, 5.0)
    hands.tick(ZERO, force, count=100)
    felt = [hands.handle.felt[2]]
    for pressed in [True] * 80 + [False] * 80:
        hands.tick(ZERO, force, pressed=pressed)
        felt.append(hands.handle.felt[2])
    assert felt[0] == felt[-1] == 5.0
    assert felt[60] == 0.0
    assert max(abs(a - b) for a, b in pairwise(felt)) == pytest.approx(5.0 * TICK / 0.05)


def test_walls_bound_position_and_push_back() -> None:
    hands = Hands(FrameMap((0.0, 0.0, 90.0), 2.0, 1.0, ZERO), walls=400.0)
    sent = hands.tick((0.03, 0.0, 0.0), count=100)
    assert sent == pytest.approx((0.0, 0.05, 0.0)), "the robot would be at 60 mm"
    assert hands.handle.felt == pytest.approx((-400.0 * 0.005, 0.0, 0.0)), "5 mm too far for the hand"
    hands.tick((0.02, 0.0, 0.0))
    assert hands.handle.felt == ZERO
    assert hands.device.spec.workspace_m == BOX


def test_wall_fades_in_after_open() -> None:
    hands = Hands(walls=1000.0)
    felt = []
    for _ in range(80):
        hands.tick((0.056, 0.0, 0.0))
        felt.append(-hands.handle.felt[0])
    assert felt[0] == 0.0
    assert felt[-1] == pytest.approx(6.0)
    assert max(b - a for a, b in pairwise(felt)) <= 6.0 * TICK / 0.05 + 1e-9


def test_wall_fades_in_after_a_stall() -> None:
    hands = Hands(walls=1000.0)
    hands.tick((0.0, 0.0, 0.05), count=60)
    hands.now += 2.0
    felt = [norm(hands.handle.felt)]
    for _ in range(60):
        hands.tick((0.0, 0.0, 0.055), (0.0, 0.0, -2.0))
        felt.append(norm(hands.handle.felt))
    assert felt[1] == 0.0
    assert max(b - a for a, b in pairwise(felt)) <= 7.0 * TICK / 0.05 * (1 + 1e-9)
    assert felt[-1] == pytest.approx(7.0)


@given(st.lists(st.tuples(st.booleans(), *[st.floats(-EDGE, EDGE)] * 3), min_size=1, max_size=60))
def test_indexing_never_jumps_nor_leaves_the_walls(script: list[tuple[bool, float, float, float]]) -> None:
    """What is sent moves no further than the hand does, whatever is pressed."""
    hands = Hands(clutch=True, walls=500.0)
    before = hands.tick(ZERO)
    hand = ZERO
    for pressed, x, y, z in script:
        sent = hands.tick((x, y, z), pressed=pressed)
        way = norm((x - hand[0], y - hand[1], z - hand[2]))
        assert norm(tuple(a - b for a, b in zip(sent, before, strict=True))) <= way + 1e-9
        assert all(a <= p <= b for a, p, b in zip(BOX[0], sent, BOX[1], strict=True))
        before, hand = sent, (x, y, z)


def test_new_session_starts_without_indexing() -> None:
    hands = Hands(clutch=True, walls=500.0)
    hands.tick((0.02, 0.0, 0.0))
    hands.tick(ZERO, pressed=True)
    hands.tick(ZERO)
    hands.device.close()
    assert not hands.handle.is_open
    hands.device.open(10.0)
    hands.now = 10.0
    assert hands.tick((0.01, 0.0, 0.0)) == (0.01, 0.0, 0.0)
