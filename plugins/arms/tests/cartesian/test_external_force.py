"""The estimate recovers what presses on the tip, as far as it says it does."""

from hypothesis import given
from hypothesis import strategies as st

from weberlink.geometry.vector import Vector, distance, norm
from weberlink_arms.cartesian.arm import COULOMB_N_M, VISCOUS_N_M_S, Joints, Mechanics, inverse_nearest
from weberlink_arms.cartesian.external_force import JointFriction, force_error, tip_force

POSE = Mechanics().pose
STILL: Joints = (0.0, 0.0, 0.0, 0.0)
places = st.tuples(st.floats(0.12, 0.26), st.floats(-0.12, 0.12), st.floats(0.05, 0.25))
forces = st.tuples(*[st.floats(-5.0, 5.0)] * 3)
signs = st.tuples(*[st.floats(-1.0, 1.0)] * 4)


def at_work(place: Vector) -> Joints:
    joints = inverse_nearest(place, 0.3)
    assert joints is not None
    return joints


def balanced(joints: Joints, force: Vector, friction: Joints = STILL) -> Joints:
    """Torques of motors that hold the arm against its weight, a force on its tip and a friction that opposes."""
    here = POSE(joints)
    a, b, c, d = (
        weight - pressed + rubbing
        for weight, pressed, rubbing in zip(here.gravity, here.torques(force), friction, strict=True)
    )
    return (a, b, c, d)


@given(places, forces, signs, st.floats(-0.4, 0.4))
def test_estimate_stays_within_stated_error(place: Vector, force: Vector, sticking: Joints, wrong: float) -> None:
    joints = at_work(place)
    here, friction = POSE(joints), JointFriction()
    e, f, g, h = (part * coulomb for part, coulomb in zip(sticking, COULOMB_N_M, strict=True))
    a, b, c, d = (torque / (1.0 + wrong) for torque in balanced(joints, force, (e, f, g, h)))  # as the currents say
    felt = tip_force(here, STILL, (a, b, c, d), friction)
    newtons, share = force_error(here, friction, 0.4)
    assert distance(felt, force) <= newtons + share * norm(felt) + 1e-9


@given(places, forces, st.tuples(*[st.floats(0.06, 1.0)] * 4), st.tuples(*[st.sampled_from((-1.0, 1.0))] * 4))
def test_in_motion_the_friction_is_taken_out(place: Vector, force: Vector, speeds: Joints, ways: Joints) -> None:
    joints = at_work(place)
    a, b, c, d = (speed * way for speed, way in zip(speeds, ways, strict=True))
    e, f, g, h = (
        coulomb * way + viscous * speed * way
        for coulomb, viscous, speed, way in zip(COULOMB_N_M, VISCOUS_N_M_S, speeds, ways, strict=True)
    )
    felt = tip_force(POSE(joints), (a, b, c, d), balanced(joints, force, (e, f, g, h)), JointFriction())
    assert distance(felt, force) < 1e-9
