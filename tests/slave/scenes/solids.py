"""Shapes and scenes that the laws are tried on, each a few centimetres large about the origin."""

from math import sin

from weberlink.geometry.vector import Vector
from weberlink.slave.scenes.height_field import HeightFieldShape, bumps
from weberlink.slave.scenes.scene import FrictionCone, Scene, SceneObject
from weberlink.slave.scenes.shape import BoxCavity, BoxShape, CarvedShape, PlaneShape, Shape, SphereShape, TurnedShape

UP: Vector = (0.0, 0.0, 1.0)
GROUND = PlaneShape((0.0, 0.0, 0.0), UP)
STIFFNESS = 500.0


def field() -> HeightFieldShape:
    heights, spacing = bumps(0.003, 0.02, 0.12)
    return HeightFieldShape(heights, spacing, (-0.06, -0.06, 0.0))


SHAPES: dict[str, Shape] = {
    "plane": PlaneShape((0.0, 0.01, 0.0), (1.0, 2.0, 3.0)),
    "sphere": SphereShape((0.01, 0.0, -0.01), 0.03),
    "sphere cavity": SphereShape((0.0, 0.01, 0.0), 0.04, inside=True),
    "box": BoxShape((0.0, 0.0, -0.01), (0.06, 0.04, 0.02)),
    "box cavity": BoxCavity((0.0, 0.0, 0.01), (0.06, 0.04, 0.05)),
    "turned box": TurnedShape(BoxShape((0.0, 0.0, -0.01), (0.06, 0.04, 0.02)), (0.0, 0.0, -0.01), (17.0, -11.0, 40.0)),
    "bowl": CarvedShape(GROUND, [SphereShape((0.0, 0.0, 0.02), 0.03, inside=True)]),
    "pocket": CarvedShape(GROUND, [BoxCavity((0.0, 0.0, 0.0), (0.04, 0.03, 0.02))]),
    "height field": field(),
}


def elastic(*shapes: Shape) -> Scene:
    return Scene([SceneObject(shape, STIFFNESS) for shape in shapes])


def wall(stiffness: float = STIFFNESS, damping: float | None = None, friction: FrictionCone | None = None) -> Scene:
    return Scene([SceneObject(GROUND, stiffness, friction, damping)])


def scenes() -> dict[str, Scene]:
    """Fresh scenes: each shape alone, then combinations with everything that a contact can have."""
    cone = FrictionCone(static=0.5, dynamic=0.4)
    everything = [SceneObject(shape, 300.0 + 100.0 * i, cone, 2.0) for i, shape in enumerate(SHAPES.values())]
    return {
        **{name: elastic(shape) for name, shape in SHAPES.items()},
        "dome on the ground": elastic(GROUND, SphereShape((0.0, 0.0, -0.01), 0.03)),
        "rough dome": Scene(
            [SceneObject(GROUND, 600.0, cone, 1.0), SceneObject(SphereShape((0.0, 0.0, 0.0), 0.02), 400.0, cone)]
        ),
        "everything": Scene(everything),
    }


def wander(count: int, depth: float = -0.004, reach: float = 0.05) -> list[Vector]:
    """A smooth path that comes from above and then roams about z = `depth`, at most 0.3 mm a tick."""
    descent = [(0.0, 0.0, 0.05 - (0.05 - depth) * i / 300.0) for i in range(300)]
    roaming = [
        (reach * sin(0.0041 * i), reach * sin(0.0033 * i), depth + 0.002 * sin(0.021 * i)) for i in range(count - 300)
    ]
    return descent + roaming
