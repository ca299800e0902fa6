"""The solution of a step with dry friction, against the conditions that define it."""

from hypothesis import example, given
from hypothesis import strategies as st

from tests.examples import examples
from weberlink.slave.emulators.dry_friction import times, with_dry_friction
from weberlink.slave.emulators.pose import Joints, Pose

angles = st.floats(-1.5, 1.5)
impulses = st.floats(-0.01, 0.01)


@example((0.0, 0.0, -1.0, 0.0), (0.0, 0.0, 0.0, -1 / 128), (0.0, 1e-5, 1e-5, 1e-5), (-1.0, -1.0, -1.0, 1.0))
@examples(150)
@given(
    st.tuples(angles, angles, angles, angles),
    st.tuples(impulses, impulses, impulses, impulses),
    st.tuples(*[st.sampled_from((0.0, 1e-5, 1e-3, 1e-2))] * 4),
    st.tuples(*[st.sampled_from((-1.0, 0.0, 1.0))] * 4),
)
def test_each_joint_slides_with_all_its_friction_or_stands_still(
    q: Joints, r: Joints, most: tuple[float, ...], before: Joints
) -> None:
    inertia, _ = Pose(q).equations((0.0, 0.0, 0.0, 0.0), 1e-4)
    v = with_dry_friction(inertia, r, most, before)
    held = [pushed - moving for pushed, moving in zip(r, times(inertia, v), strict=True)]
    for friction, limit, velocity in zip(held, most, v, strict=True):
        assert abs(friction) <= limit + 1e-12
        if velocity != 0.0 and limit > 0.0:
            assert abs(friction - (limit if velocity > 0.0 else -limit)) < 1e-12
