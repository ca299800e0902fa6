"""The scene as a body with a velocity feels it: `touch`, `state`, `restore`, `facing`."""

import pytest

from tests.slave.scenes.solids import SHAPES, scenes, wander
from weberlink.geometry.vector import ZERO, add, norm, scale
from weberlink.slave.scenes.contact import FrictionCone, SceneObject
from weberlink.slave.scenes.scene import Scene

TICK = 0.001
CONE = FrictionCone(0.5, 0.4)


@pytest.mark.parametrize("name", sorted(SHAPES))
@pytest.mark.parametrize("cone", [None, CONE], ids=["smooth", "rough"])
def test_springs_and_friction_are_those_of_the_force(name: str, cone: FrictionCone | None) -> None:
    felt, touched = (Scene([SceneObject(SHAPES[name], 500.0, cone)]) for _ in range(2))
    pressed = 0
    for position in wander(1000):
        total = ZERO
        for touch in touched.touch(position):
            total = add(total, add(scale(touch.normal, touch.stiffness * touch.depth), touch.drag))
            assert norm(touch.normal) == pytest.approx(1.0)
        force = felt.force(position, TICK)
        assert total == pytest.approx(force, abs=1e-12)
        assert touched.penetration_depth == felt.penetration_depth
        assert touched.contacts == felt.contacts
        pressed += force != ZERO
    assert pressed > 50


@pytest.mark.parametrize("name", sorted(scenes()))
def test_restore_undoes_all_changes(name: str) -> None:
    straight, trying = scenes()[name], scenes()[name]
    for i, position in enumerate(wander(700)):
        if i % 7 == 0:
            state = trying.state
            for side in (0.001, -0.002, 0.003):
                trying.touch(add(position, (side, 0.5 * side, -side)))
            trying.restore(state)
        assert trying.touch(position) == straight.touch(position)
        assert trying.state == straight.state
        assert trying.force(position, TICK) == straight.force(position, TICK)
