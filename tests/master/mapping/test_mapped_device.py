"""A mapped device: the map between frames, what is sent and felt, indexing and walls."""

from itertools import pairwise

import pytest
from hypothesis import given, strategies as st

from tests.examples import examples
from tests.master.handle import Handle
from weberlink.geometry.rotation import angle_between, inverse, product, quaternion, turned, vector
from weberlink.geometry.vector import ZERO, Vector, add, cube, distance, dot, norm, scale, subtract, unit
from weberlink.master.devices.contract import DeviceReading, TorqueDevice
from weberlink.master.mapping.mapped_device import Clutch, FrameMap, MappedDevice, Walls

TICK = 0.001
EDGE, BOX = 0.06, cube(0.05)  # of the handle's workspace, and the box of the walls
SAME = FrameMap((0.0, 0.0, 0.0), 1.0, 1.0, ZERO)

triples = st.tuples(*[st.floats(-1.0, 1.0)] * 3)
axes = triples.filter(lambda axis: norm(axis) > 0.1).map(unit)
scales = st.floats(0.1, 10.0)


# --- the map alone


@examples(60)
@given(st.tuples(*[st.floats(-360.0, 360.0)] * 3), scales, scales, triples, triples, axes)
def test_laws_of_the_map(turn: Vector, s: float, f: float, a: Vector, b: Vector, axis: Vector) -> None:
    """Power scales by one constant, which is why a passive scene stays passive through the map."""
    frame, handle = FrameMap(turn, s, f, (0.1, -0.2, 0.3)), quaternion(scale(axis, 0.7))
    moved = subtract(frame.position(add(a, b)), frame.position(a))
    assert norm(moved) == pytest.approx(s * norm(b), abs=1e-12)
    assert frame.way(moved) == pytest.approx(b, abs=1e-12)
    assert dot(frame.force(a), b) == pytest.approx(f / s * dot(a, moved), abs=1e-9)
    # A turn w of the hand is one of the tool by R w, and torque . w is kept but for the scale of the force.
    tool = frame.orientation(handle)
    way = subtract(frame.position(turned(handle, b)), frame.position(ZERO))
    assert turned(tool, subtract(frame.position(b), frame.position(ZERO))) == pytest.approx(way, abs=1e-9)
    assert dot(frame.force(a), scale(axis, 0.7)) == pytest.approx(f * dot(a, vector(tool)), abs=1e-9)
    low, high = frame.box(((-1.0, -1.0, -1.0), (1.0, 1.0, 1.0)))
    assert all(c - 1e-9 <= p <= d + 1e-9 for c, p, d in zip(low, frame.position(a), high, strict=True))


@pytest.mark.parametrize(
    ("turn", "moved"),
    [
        ((0, 0, 180), (-1.0, -2.0, 3.0)),
        ((0, 0, -90), (2.0, -1.0, 3.0)),
        ((0, 90, 0), (3.0, 2.0, -1.0)),
        ((90, 0, 90), (3.0, 1.0, 2.0)),  # x first, then z
    ],
)
def test_right_angles_are_exact(turn: Vector, moved: Vector) -> None:
    assert FrameMap(turn, 1, 1, ZERO).position((1.0, 2.0, 3.0)) == moved


# --- the device


class Hands:
    """A mapped handle, moved, turned and told tick by tick."""

    def __init__(
        self, frame: FrameMap = SAME, *, walls: float | None = None, limit: float = 10.0, torque_n_m: float = 0.4
    ) -> None:
        self.handle = Handle(torque_n_m=torque_n_m)
        wall = None if walls is None else Walls(BOX, walls)
        self.device = MappedDevice(self.handle, frame, clutch=Clutch(1), walls=wall, force_limit=limit, ramp=0.05)
        self.now = 0.0
        self.device.open(0.0)

    def read(self, position: Vector = ZERO, turn: Vector = ZERO, *, pressed: bool = False) -> DeviceReading:
        self.now += TICK
        self.handle.reading = DeviceReading(
            self.now, position, orientation=quaternion(turn), buttons=2 if pressed else 0
        )
        return self.device.latest(self.now)

    @property
    def felt(self) -> Vector:
        return self.handle.forces[-1] if self.handle.forces else ZERO

    def tick(
        self, position: Vector, force: Vector = ZERO, torque: Vector = ZERO, *, pressed: bool = False, count: int = 1
    ) -> Vector:
        """The position that is sent, at the last of `count` ticks."""
        for _ in range(count):
            reading = self.read(position, pressed=pressed)
            self.device.command(force, self.now)
            self.device.turn(torque, self.now)
        return reading.position


def test_motion_force_turn_torque_and_spec_are_in_robot_frame() -> None:
    hands = Hands(FrameMap((0.0, 0.0, 90.0), 2.0, 0.5, (0.0, 0.0, 0.1)))
    assert isinstance(hands.device, TorqueDevice)
    place = hands.tick((0.01, 0.0, 0.0), (0.0, 3.0, 0.0), (0.0, 0.6, 0.1))
    assert place == pytest.approx((0.0, 0.02, 0.1))
    assert hands.felt == pytest.approx((1.5, 0.0, 0.0))
    assert hands.handle.torques[-1] == pytest.approx((0.3, 0.0, 0.05))
    orientation = hands.read(turn=(0.3, 0.0, 0.2)).orientation
    assert orientation is not None
    assert vector(orientation) == pytest.approx((0.0, 0.3, 0.2))
    spec = hands.device.spec
    assert (spec.force_n, spec.stiffness_n_m, spec.torque_n_m) == (16.0, 2000.0, 0.8), "8 N and 0.4 N m in the hand"
    assert spec.workspace_m[0] == pytest.approx((-0.12, -0.12, -0.02))
    assert spec.workspace_m[1] == pytest.approx((0.12, 0.12, 0.22))


def test_the_limit_is_that_of_the_hand_and_no_torque_is_told_to_a_device_without() -> None:
    hands = Hands(FrameMap((0.0, 0.0, 0.0), 1.0, 4.0, ZERO), limit=6.0, torque_n_m=0.0)
    hands.tick(ZERO, (0.0, 100.0, 0.0), (0.0, 0.0, 0.2))
    assert norm(hands.felt) == pytest.approx(6.0)
    assert (hands.device.spec.force_n, hands.handle.torques) == (1.5, [])


def test_held_clutch_keeps_position_and_orientation_until_a_new_session() -> None:
    hands = Hands(walls=500.0)
    before = hands.read((0.02, 0.0, 0.0), (0.5, 0.0, 0.0))
    for place, turn in (((0.01, 0.01, 0.0), (0.2, 0.3, 0.0)), ((-0.02, 0.03, 0.0), (0.0, 0.0, -0.4))):
        held = hands.read(place, turn, pressed=True)
        assert (held.position, held.orientation) == (before.position, before.orientation)
    assert hands.read((-0.02, 0.03, 0.0), (0.0, 0.0, -0.4)).position == pytest.approx((0.02, 0.0, 0.0))
    on = hands.read((-0.01, 0.03, 0.0), (0.0, 0.0, -0.3))
    assert on.position == pytest.approx((0.03, 0.0, 0.0))
    assert on.orientation is not None and before.orientation is not None
    by = vector(product(on.orientation, inverse(before.orientation)))
    assert by == pytest.approx((0.0, 0.0, 0.1)), "about z, as the hand turned"
    hands.device.close()
    assert not hands.handle.is_open
    hands.device.open(hands.now)
    assert hands.tick((0.01, 0.0, 0.0)) == (0.01, 0.0, 0.0)


def test_force_and_torque_fade_with_the_clutch_without_jumps() -> None:
    hands, force = Hands(walls=500.0), (0.0, 0.0, 5.0)
    hands.tick(ZERO, force, count=100)
    felt = [hands.felt[2]]
    for pressed in [True] * 80 + [False] * 80:
        hands.tick(ZERO, force, (0.0, 0.0, 0.3), pressed=pressed)
        felt.append(hands.felt[2])
        assert hands.handle.torques[-1][2] == pytest.approx(0.3 * felt[-1] / 5.0)
    assert (felt[0], felt[60], felt[-1]) == (5.0, 0.0, 5.0)
    assert max(abs(a - b) for a, b in pairwise(felt)) == pytest.approx(5.0 * TICK / 0.05)


def test_walls_bound_position_and_push_back() -> None:
    hands = Hands(FrameMap((0.0, 0.0, 90.0), 2.0, 1.0, ZERO), walls=400.0)
    sent = hands.tick((0.03, 0.0, 0.0), count=100)
    assert sent == pytest.approx((0.0, 0.05, 0.0)), "the robot would be at 60 mm"
    assert hands.felt == pytest.approx((-400.0 * 0.005, 0.0, 0.0)), "5 mm too far for the hand"
    hands.tick((0.02, 0.0, 0.0))
    assert hands.felt == ZERO
    assert hands.device.spec.workspace_m == BOX
    corner = Hands(walls=400.0)
    assert corner.tick((0.03, -0.058, 0.055), count=100) == (0.03, -0.05, 0.05)
    assert corner.felt == pytest.approx((0.0, 400.0 * 0.008, -400.0 * 0.005)), "each axis by itself"


@pytest.mark.parametrize("stalls", [False, True], ids=["open", "stall"])
def test_wall_fades_in_after(stalls: bool) -> None:
    hands = Hands(walls=1000.0)
    if stalls:
        hands.tick((0.0, 0.0, 0.05), count=60)
        hands.now += 2.0
    felt = [norm(hands.felt)]
    for _ in range(80):
        hands.tick((0.0, 0.0, 0.055), (0.0, 0.0, -2.0 if stalls else 0.0))
        felt.append(norm(hands.felt))
    full = 7.0 if stalls else 5.0
    assert (felt[1], felt[-1]) == (0.0, pytest.approx(full))
    assert max(b - a for a, b in pairwise(felt)) <= full * TICK / 0.05 * (1 + 1e-9)


@given(st.lists(st.tuples(st.booleans(), triples), min_size=1, max_size=60))
def test_indexing_never_jumps_nor_leaves_the_walls(script: list[tuple[bool, Vector]]) -> None:
    """What is sent moves and turns no further than the hand does, whatever is pressed."""
    hands = Hands(walls=500.0)
    before, last = hands.read(), ZERO
    for pressed, turn in script:
        sent = hands.read(scale(turn, EDGE), turn, pressed=pressed)
        assert distance(sent.position, before.position) <= EDGE * distance(turn, last) + 1e-9
        assert all(a <= p <= b for a, p, b in zip(BOX[0], sent.position, BOX[1], strict=True))
        assert before.orientation is not None and sent.orientation is not None
        way = angle_between(quaternion(last), quaternion(turn))
        assert angle_between(before.orientation, sent.orientation) <= way + 1e-7
        before, last = sent, turn
