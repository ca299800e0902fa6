"""A leader in the frame of the follower: which joint drives which, by how much, and what is felt of it."""

from math import inf, isnan, nan
from typing import Any

import pytest
from hypothesis import assume, given, strategies as st
from pydantic import ValidationError

from tests.arms.ends import Hand, spec
from weberlink.arms.mapping import LeaderMappingSettings
from weberlink.geometry.joints import Joints, is_finite
from weberlink.master.mapping.mapped_leader import MappedLeader

LEADER = spec(
    name="leader", joints=("pan", "lift", "roll"), lower=(-2.0, -1.0, -3.0, 0.1), upper=(2.0, 1.5, 3.0, 0.6),
    torque_nm=(1.0, 0.8, 0.6, 0.4), stiffness_nm_rad=(10.0, 8.0, 6.0, 4.0),
)  # fmt: skip
JOINTS = ("base", "elbow", "wrist", "roll")
MOVED: dict[str, Any] = {
    "joints": {
        "base": {"leader": "lift", "scale": -2.0, "offset_rad": 0.5},
        "elbow": {"leader": "pan", "scale": 0.5},
        "wrist": {"rest_rad": 0.3},
        "roll": {"leader": "roll"},
    },
    "gripper": {"leader_rad": [0.1, 0.6], "follower_rad": [1.5, 0.0]},
    "torque_scale": 0.25,
}


def mapped(
    hand: Hand | None = None, names: tuple[str, ...] = JOINTS, *, has_gripper: bool = True, **settings: Any
) -> Any:
    return MappedLeader(hand or Hand(LEADER), LeaderMappingSettings.model_validate(settings), names, has_gripper)


def angles_of(leader: Joints, **settings: Any) -> Joints:
    hand = Hand(LEADER)
    hand.angles = leader
    angles: Joints = mapped(hand, **settings).latest(0.0).angles
    return angles


WHOLE: dict[str, Any] = MOVED | {"gripper": {"follower_rad": [0.0, 1.0]}}


@pytest.mark.parametrize(
    ("settings", "leader", "follower"),
    [
        (MOVED, (0.4, 0.2, -1.0, 0.35), (0.1, 0.2, 0.3, -1.0, 0.75)),
        (MOVED, (0.0, 0.0, 0.0, 0.0), (0.5, 0.0, 0.3, 0.0, 1.5)),  # a gripper stays within its range
        (MOVED, (0.0, 0.0, 0.0, 0.9), (0.5, 0.0, 0.3, 0.0, 0.0)),
        (WHOLE, (0.0, 0.0, 0.0, 0.1), (0.5, 0.0, 0.3, 0.0, 0.0)),  # the whole one of the leader by default
        (WHOLE, (0.0, 0.0, 0.0, 0.6), (0.5, 0.0, 0.3, 0.0, 1.0)),
    ],
)
def test_angles_are_those_of_the_follower(settings: dict[str, Any], leader: Joints, follower: Joints) -> None:
    assert angles_of(leader, **settings) == pytest.approx(follower)


@given(
    leader=st.tuples(*[st.floats(-1.0, 1.0)] * 3, st.floats(0.15, 0.55)),
    moved=st.tuples(*[st.floats(-0.05, 0.05)] * 4),
    torques=st.tuples(*[st.floats(-5.0, 5.0)] * 5),
    scales=st.tuples(*[st.floats(-10.0, 10.0)] * 2),
    torque_scale=st.floats(1e-3, 100.0),
)
def test_power_of_leader_is_that_of_follower_times_scale(
    leader: Joints, moved: Joints, torques: Joints, scales: tuple[float, float], torque_scale: float
) -> None:
    """The map of torques is the transpose of the map of angles."""
    assume(all(abs(scale) > 1e-3 for scale in scales))
    joints = MOVED["joints"] | {
        "base": {"leader": "lift", "scale": scales[0], "offset_rad": 0.5},
        "roll": {"leader": "roll", "scale": scales[1]},
    }
    hand = Hand(LEADER)
    arm = mapped(hand, **(MOVED | {"joints": joints, "torque_scale": torque_scale}))
    hand.angles = leader
    before = arm.latest(0.0).angles
    hand.angles = tuple(angle + step for angle, step in zip(leader, moved, strict=True))
    after = arm.latest(0.001).angles
    arm.command(torques, 0.001)
    at_follower = sum(torque * (b - a) for torque, a, b in zip(torques, before, after, strict=True))
    at_leader = sum(torque * (b - a) for torque, a, b in zip(hand.felt[-1], leader, hand.angles, strict=True))
    assert at_leader == pytest.approx(torque_scale * at_follower, abs=1e-9 * torque_scale, rel=1e-6)


def test_spec_is_in_the_frame_of_the_follower() -> None:
    hand = Hand(LEADER)
    arm = mapped(hand, **MOVED)
    found = arm.spec
    assert (found.joints, found.gripper, found.axes) == (JOINTS, True, 5)
    assert found.lower == pytest.approx((-2.5, -1.0, 0.3, -3.0, 0.0))
    assert found.upper == pytest.approx((2.5, 1.0, 0.3, 3.0, 1.5))
    assert found.torque_nm == pytest.approx((0.8 / 0.5, 1.0 / 0.125, 0.0, 0.6 / 0.25, 0.4 / 0.75))
    assert found.stiffness_nm_rad[:2] == pytest.approx((8.0 / 1.0, 10.0 / 0.0625))
    assert min(found.stiffness_nm_rad) > 0.0
    arm.command(found.torque_nm, 0.0)
    assert [abs(torque) for torque in hand.felt[-1]] == pytest.approx(LEADER.torque_nm), "the largest on the leader"


@pytest.mark.parametrize(
    ("names", "how", "follower"),
    [
        (("a", "b", "c"), {}, (0.1, 0.2, 0.3, 0.4)),
        (("a", "b"), {"has_gripper": False}, (0.1, 0.2)),
        (("roll", "pan"), {"match": "name"}, (0.3, 0.1, 0.4)),
    ],
)
def test_joints_drive_by_order_or_by_name(names: tuple[str, ...], how: dict[str, Any], follower: Joints) -> None:
    hand = Hand(LEADER)
    hand.angles = (0.1, 0.2, 0.3, 0.4)
    assert mapped(hand, names, **how).latest(0.0).angles == follower


def test_leader_without_gripper_leaves_it_at_rest_and_drives_none() -> None:
    hand = Hand(spec(gripper=False, lower=(-1.0, -1.0), upper=(1.0, 1.0)))
    arm = mapped(hand, ("a", "b"), gripper={"rest_rad": 0.2})
    assert arm.latest(0.0).angles == (0.0, 0.0, 0.2)
    arm.command((0.1, 0.2, 5.0), 0.0)
    assert hand.felt[-1] == (0.1, 0.2)
    with pytest.raises(ValueError, match="gripper: arm has none; give rest_rad"):
        mapped(hand, ("a", "b"))


@given(st.sampled_from((nan, inf, -inf)), st.integers(0, 3))
def test_what_is_not_finite_stays_so_and_is_not_displayed(value: float, axis: int) -> None:
    leader = tuple(value if axis == place else 0.2 for place in range(4))
    assert not is_finite(angles_of(leader, **(MOVED | {"gripper": {}})))
    assert not (isnan(value) and is_finite(angles_of(leader, **MOVED)))
    hand = Hand(LEADER)
    with pytest.raises(ValueError, match="finite"):
        mapped(hand, **MOVED).command((*leader, 0.0), 0.0)
    assert hand.felt == []


@pytest.mark.parametrize(
    ("settings", "complaint"),
    [
        ({}, "joints.roll: leader has 3 joints; give leader, one of pan, lift, roll, or rest_rad"),
        ({"match": "name"}, "joints.base: leader has no joint base"),
        ({"joints": {"tip": {}}}, "joints.tip: the follower has base, elbow, wrist, roll"),
        ({"joints": {"roll": {"leader": "pan"}}}, "joints.roll: pan of leader drives base already"),
        ({"joints": {"roll": {"leader": "tip"}}}, "joints.roll: leader has no joint tip"),
        ({"joints": {"roll": {"scale": 0.0}}}, "scale must not be 0"),
        ({"joints": {"roll": {"rest_rad": 0.0, "scale": 2.0}}}, "leave out leader, scale"),
        ({"gripper": {"leader_rad": [0.0, 1.0]}}, "leader_rad needs follower_rad"),
        ({"gripper": {"follower_rad": [1.0, 1.0]}}, "follower_rad: closed and open must differ"),
        ({"gripper": {"follower_rad": [0.0, 1.0], "rest_rad": 0.0}}, "leave out follower_rad"),
        ({"torque_scale": nan}, "finite"),
    ],
)
def test_map_that_cannot_be_is_refused(settings: dict[str, Any], complaint: str) -> None:
    with pytest.raises((ValueError, ValidationError), match=complaint):
        mapped(**settings)
