"""The linkage against geometry, numerical differentiation and the principle of virtual work."""

from math import hypot, nan

import pytest
from hypothesis import assume, given, strategies as st

from tests.examples import examples
from weberlink_devices.haply.board import Pair
from weberlink_devices.haply.linkage import VERSIONS, HaplyFrame, PlanarFiveBar, Unreachable, radians

every_version = pytest.mark.parametrize("name", sorted(VERSIONS))
STEP = 1e-6

shares = st.tuples(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0))
forces = st.tuples(st.floats(-5.0, 5.0), st.floats(-5.0, 5.0))


def point(name: str, share: Pair) -> Pair:
    """A point of the workspace, by its share of the way to the edges."""
    version = VERSIONS[name]
    return (version.center[0] + share[0] * version.reach[0], version.center[1] + share[1] * version.reach[1])


def usable(name: str, share: Pair) -> tuple[PlanarFiveBar, Pair, Pair]:
    """Linkage, tip and angles, where the linkage gets there and is not singular."""
    bar, tip = VERSIONS[name].bar, point(name, share)
    try:
        angles = bar.angles(tip)
        bar.jacobian(angles)
    except Unreachable:
        assume(False)
    x, y = bar.tip(angles)
    assume(hypot(x - tip[0], y - tip[1]) < 1e-3)  # far to the side and low, the tip is the lower of the two points
    return bar, tip, angles


@every_version
@examples(30)
@given(share=shares)
def test_the_jacobian_is_the_derivative(name: str, share: Pair) -> None:
    bar, _, (first, second) = usable(name, share)
    jacobian = bar.jacobian((first, second))
    try:
        ahead, behind = ((bar.tip((first + way, second)), bar.tip((first, second + way))) for way in (STEP, -STEP))
    except Unreachable:
        assume(False)
    (x1, y1), (x2, y2) = (
        ((a[0] - b[0]) / (2.0 * STEP), (a[1] - b[1]) / (2.0 * STEP)) for a, b in zip(ahead, behind, strict=True)
    )
    # The error of the difference grows with the third derivative, so with the nearness of a singular posture.
    near = max(1.0, max(map(abs, jacobian)) / bar.inner)
    assert tuple(jacobian) == pytest.approx((x1, x2, y1, y2), abs=1e-6 * near**3)


@every_version
@examples(30)
@given(share=shares, force=forces, turn=st.tuples(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0)))
def test_motors_and_tip_do_the_same_work(name: str, share: Pair, force: Pair, turn: Pair) -> None:
    bar, _, angles = usable(name, share)
    jacobian = bar.jacobian(angles)
    first, second = jacobian.torques(force)
    moved = (jacobian.x1 * turn[0] + jacobian.x2 * turn[1], jacobian.y1 * turn[0] + jacobian.y2 * turn[1])
    assert first * turn[0] + second * turn[1] == pytest.approx(force[0] * moved[0] + force[1] * moved[1], abs=1e-9)
    assert jacobian.force((first, second)) == pytest.approx(force, abs=1e-6)
    assert HaplyFrame.planar(HaplyFrame.force(force)) == force and HaplyFrame.force(force)[2] == 0.0


def test_postures_that_follow_from_the_published_numbers() -> None:
    """By hand: A = (0.07 cos 168, 0.07 sin 168), B = (0.038 + 0.07 cos 12, 0.07 sin 12), tip above their middle."""
    x, y = VERSIONS["v3"].bar.tip(radians((168.0, 12.0)))
    half = 0.019 + 0.07 * 0.9781476007338057
    assert (x, y) == pytest.approx((0.019, 0.07 * 0.20791169081775934 + (0.09**2 - half**2) ** 0.5), abs=1e-12)
    assert VERSIONS["pantograph"].bar.tip(radians((180.0, 0.0))) == pytest.approx((0.01, (0.07**2 - 0.06**2) ** 0.5))
    up = VERSIONS["pantograph"].bar.tip(radians((90.0, 90.0)))
    assert up == pytest.approx((0.01, 0.05 + (0.07**2 - 0.01**2) ** 0.5)), "arms straight up, 20 mm apart"


def test_what_cannot_be_is_said() -> None:
    bar = VERSIONS["v3"].bar
    with pytest.raises(Unreachable, match=r"elbows are 178\.0 mm apart, the outer links reach 160 mm"):
        PlanarFiveBar(0.07, 0.08, 0.038).tip(radians((180.0, 0.0)))
    with pytest.raises(Unreachable, match="elbows"):
        VERSIONS["v2"].bar.tip((1.0, 1.0))  # both elbows in one place: any point around it will do
    with pytest.raises(Unreachable, match="in line"):
        PlanarFiveBar(0.07, 0.09, 0.0399999).jacobian(radians((180.0, 0.0)))
    for tip in ((0.2, 0.2), (0.0, 0.001)):
        with pytest.raises(Unreachable, match="out of reach"):
            bar.angles(tip)
    for angles in ((nan, 0.0), (0.0, nan)):
        with pytest.raises(Unreachable):
            bar.tip(angles)
