"""What the live view for Foxglove draws: the fitted surface, solids, arrows."""

from math import radians
from typing import Any

import numpy as np
import pytest
from foxglove_schemas_protobuf.ArrowPrimitive_pb2 import ArrowPrimitive
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from hypothesis import given
from hypothesis import strategies as st

from tests.apps.monitor.synthetic_session import EVERY_SHAPE
from weberlink.apps.bridge.foxglove import motion
from weberlink.apps.bridge.foxglove.patch import PLANE, RINGS, SPHERE, SPOKES, TRIANGLES, patch
from weberlink.apps.bridge.foxglove.primitives import X, Z, arrow, color, toward
from weberlink.apps.bridge.foxglove.solids import reach_of, scene_update
from weberlink.geometry.rotation import quaternion, turned
from weberlink.geometry.vector import norm, scale
from weberlink.telemetry.reader import DTYPE

COORDINATES = st.floats(-1.0, 1.0)
DIRECTIONS = st.tuples(COORDINATES, COORDINATES, COORDINATES).filter(lambda v: norm(v) > 1e-3)
PRIMITIVES = {"arrows", "cubes", "spheres", "cylinders", "lines", "triangles", "texts", "models"}
AT_NS = 1_763_000_000_123_456_789


def record(**fields: Any) -> Any:
    made = np.zeros(1, DTYPE)
    for name, value in fields.items():
        made[name] = value
    return made[0]


def parsed(message: Any) -> SceneUpdate:
    """As the published classes read it, all of it."""
    read = SceneUpdate.FromString(message.encode())
    assert read.SerializeToString(deterministic=True) and not [
        each for each in read.entities if not each.HasField("timestamp") or not each.HasField("lifetime")
    ]
    return read


def numbers(of: Any, names: str = "xyz") -> list[float]:
    return [getattr(of, name) for name in names]


def moved(pose: Any, point: tuple[float, float, float]) -> np.ndarray[Any, Any]:
    """A point of a primitive in the frame of its entity."""
    x, y, z, w = numbers(pose.orientation, "xyzw")
    return np.array(turned((w, x, y, z), point)) + numbers(pose.position)


@given(DIRECTIONS, st.floats(-0.1, 0.1), DIRECTIONS, st.floats(0.01, 0.2))
def test_patch_of_a_plane_lies_on_it(normal: Any, offset: float, point: Any, reach: float) -> None:
    unit = np.array(scale(normal, 1.0 / norm(normal)))
    corners = patch(record(model=PLANE, surface=unit, surface_size=offset), point, reach)
    assert corners is not None and corners.shape == ((RINGS + 1) * SPOKES, 3)
    assert np.abs(corners @ np.float32(unit) + np.float32(offset)).max() < 1e-6
    assert np.linalg.norm(corners - corners[0], axis=1).max() == pytest.approx(reach)


@given(DIRECTIONS, st.floats(-0.5, 0.5).filter(lambda r: abs(r) > 1e-3), DIRECTIONS)
def test_patch_of_a_sphere_lies_on_it(center: Any, radius: float, away: Any) -> None:
    made = record(model=SPHERE, surface=center, surface_size=radius)
    point = np.array(made["surface"], float) + away
    corners = patch(made, tuple(point), 0.05)
    assert corners is not None
    assert np.linalg.norm(corners - made["surface"], axis=1) == pytest.approx(abs(np.float32(radius)))
    nearest = point - np.array(made["surface"], float)
    assert (corners[0] - made["surface"]) @ nearest == pytest.approx(abs(np.float32(radius)) * np.linalg.norm(nearest))


@pytest.mark.parametrize(
    "fields",
    [
        {"model": 0},
        {"model": 1},
        {"model": PLANE, "surface": np.nan},
        {"model": PLANE, "surface": 0.0},
        {"model": SPHERE, "surface": (0.0, 0.0, 1.0), "surface_size": 0.0},
        {"model": SPHERE, "surface": (0.0, 0.0, 0.0), "surface_size": 1.0},
    ],
)
def test_no_patch_without_a_surface(fields: dict[str, Any]) -> None:
    assert patch(record(**fields), (0.0, 0.0, 0.0), 0.1) is None


def test_triangles_name_every_corner() -> None:
    assert sorted(set(TRIANGLES)) == list(range((RINGS + 1) * SPOKES)) and len(TRIANGLES) == 6 * RINGS * SPOKES


@given(DIRECTIONS, st.sampled_from((X, Z)))
def test_a_vector_is_turned_into_a_direction(direction: Any, of: Any) -> None:
    for aim in (direction, of, scale(of, -2.0)):
        assert turned(quaternion(toward(aim, of)), of) == pytest.approx(scale(aim, 1.0 / norm(aim)), abs=1e-6)


@given(DIRECTIONS)
def test_an_arrow_ends_where_its_vector_does(along: Any) -> None:
    made = arrow((0.1, 0.2, 0.3), along, 0.001, color("#ffffff"))
    read = ArrowPrimitive.FromString(made.encode())
    tip = moved(read.pose, (read.shaft_length + read.head_length, 0.0, 0.0))
    assert tip == pytest.approx(np.array((0.1, 0.2, 0.3)) + along, abs=1e-6)


def test_every_shape_is_drawn_in_place_of_the_former() -> None:
    read = parsed(scene_update(EVERY_SHAPE, [(0.03, 0.0, 0.0)], AT_NS))
    (deletion,) = read.deletions
    assert deletion.type == 1 and deletion.timestamp.ToNanoseconds() == AT_NS
    kinds = [[kind.name for kind, _ in each.ListFields() if kind.name in PRIMITIVES] for each in read.entities]
    assert kinds == [
        ["cubes"], ["spheres"], ["spheres"], ["cubes"], ["cubes"], ["triangles"], [], ["cubes", "spheres"], ["lines"]
    ]  # fmt: skip
    assert [each.frame_id for each in read.entities] == ["weberlink"] * 8 + ["robot"]
    assert len({each.id for each in read.entities}) == len(read.entities)


def test_solids_are_where_the_scene_has_them() -> None:
    tilted = {"shape": "plane", "point_m": [0.0, 0.0, 0.01], "normal": [0.0, 2.0, 2.0]}
    box = {"shape": "box", "center_m": [0.1, 0.0, 0.0], "size_m": [0.02, 0.04, 0.06], "rotation_deg": [90.0, 0.0, 30.0]}
    field = {
        "shape": "height_field",
        "center_m": [0, 0, 0.5],
        "heights_m": [[0, 0.1, 0.2], [0.3, 0, 0]],
        "spacing_m": 1.0,
    }
    plane, block, terrain = parsed(scene_update([tilted, box, field], [], AT_NS)).entities
    top = plane.cubes[0]
    assert moved(top.pose, (0.0, 0.0, 0.5 * top.size.z)) == pytest.approx(np.array((0.0, 0.005, 0.005)))
    turn = radians(30.0)
    (cube,) = block.cubes
    assert moved(cube.pose, (0.01, 0.0, 0.0)) - (0.1, 0, 0) == pytest.approx(
        0.01 * np.array((np.cos(turn), np.sin(turn), 0))
    )
    assert moved(cube.pose, (0.0, 0.02, 0.0)) - (0.1, 0, 0) == pytest.approx(np.array((0.0, 0.0, 0.02)), abs=1e-9)
    corners = [numbers(point) for point in terrain.triangles[0].points]
    assert corners[:3] == [[-1.0, -0.5, 0.5], [0.0, -0.5, 0.6], [1.0, -0.5, 0.7]] and corners[3] == [-1.0, 0.5, 0.8]
    assert max(terrain.triangles[0].indices) == 5 and len(terrain.triangles[0].indices) == 12


@given(st.lists(st.sampled_from(EVERY_SHAPE)))
def test_reach_holds_every_bounded_center(scene: Any) -> None:
    assert reach_of(scene) >= max((np.hypot(*shape.get("center_m", (0, 0))[:2]) for shape in scene), default=0.0)


def test_force_below_the_threshold_has_no_arrow() -> None:
    for force, count in (((0.0, 0.0, 0.001), 0), ((0.0, 0.0, 1.0), 1)):
        (body, surface) = parsed(motion.bodies({"master": (record(output=force), AT_NS)}, 0.055)).entities
        assert (body.id, len(body.arrows), surface.id, len(surface.triangles)) == ("hand", count, "surface", 0)


def test_places_of_packets_are_those_of_sent_updates() -> None:
    slave = np.zeros(100, DTYPE)
    slave["tick"], slave["sent"][[3, 70]] = np.arange(100), 1
    slave["output"][70] = (0.01, 0.02, 0.03)
    update = motion.packets(slave, np.arange(100) + AT_NS, 0.055)
    entities = parsed(update).entities
    assert [each.id for each in entities] == ["packet 3", "packet 70"]
    assert entities[1].lifetime.seconds == motion.PACKETS_S and entities[1].timestamp.ToNanoseconds() == AT_NS + 70
    assert numbers(entities[1].spheres[0].pose.position) == pytest.approx([0.01, 0.02, 0.03])
    assert motion.packets(slave[:3], np.arange(3) + AT_NS, 0.055) is None
