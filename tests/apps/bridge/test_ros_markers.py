"""The markers of a scene, and of hand and robot with their forces."""

from math import radians
from typing import Any

import numpy as np
import pytest

from weberlink.apps.ros_markers import (
    CUBE,
    LINE_LIST,
    MARKERS,
    SPHERE,
    TRIANGLE_LIST,
    scene_markers,
)
from weberlink.geometry.rotation import turned
from weberlink.ros2.messages import decode
from weberlink.telemetry.recording.message import ENCAPSULATION


def markers(body: bytes) -> list[Any]:
    made: list[Any] = decode(ENCAPSULATION + body, MARKERS).markers
    return made


def numbers(point: Any) -> tuple[float, float, float]:
    return point.x, point.y, point.z


def moved(marker: Any, point: tuple[float, float, float]) -> Any:
    """A point of a marker in the frame that it is in."""
    q = marker.pose.orientation
    return np.add(numbers(marker.pose.position), turned((q.w, q.x, q.y, q.z), point))


PLANE = {"shape": "plane", "point_m": [0, 0, 0], "normal": [0, 0, 1]}
BALL = {"shape": "sphere", "center_m": [0, 0, 0.03], "radius_m": 0.02, "inside": True, "carve": []}
BOX = {"shape": "box", "center_m": [0, 0, 0], "size_m": [0.02, 0.01, 0.02], "rotation_deg": None, "inside": True}
FIELD = {"shape": "height_field", "center_m": [0, 0, 0], "heights_m": [[0, 0.001], [0.002, 0]], "spacing_m": 0.01}


def test_every_shape_is_a_marker() -> None:
    unknown = FIELD | {"heights_m": None, "spacing_m": None}
    made = markers(scene_markers([PLANE, BALL, BOX, FIELD, unknown], [(0.03, 0.0, 0.0)]))
    assert [each.type for each in made] == [CUBE, SPHERE, CUBE, TRIANGLE_LIST, LINE_LIST]
    assert [each.header.frame_id for each in made] == ["weberlink"] * 4 + ["robot"]
    assert len({(each.ns, each.id) for each in made}) == len(made)


def test_solids_are_where_the_scene_has_them() -> None:
    tilted = {"shape": "plane", "point_m": [0.0, 0.0, 0.01], "normal": [0.0, 2.0, 2.0]}
    box = {"shape": "box", "center_m": [0.1, 0.0, 0.0], "size_m": [0.02, 0.04, 0.06], "rotation_deg": [90.0, 0.0, 30.0]}
    field = {
        "shape": "height_field",
        "center_m": [0, 0, 0.5],
        "heights_m": [[0, 0.1, 0.2], [0.3, 0, 0]],
        "spacing_m": 1.0,
    }
    plane, block, terrain = markers(scene_markers([tilted, box, field], []))
    assert moved(plane, (0.0, 0.0, 0.5 * plane.scale.z)) == pytest.approx((0.0, 0.005, 0.005))
    turn = radians(30.0)
    assert moved(block, (0.01, 0.0, 0.0)) == pytest.approx((0.1 + 0.01 * np.cos(turn), 0.01 * np.sin(turn), 0.0))
    assert moved(block, (0.0, 0.02, 0.0)) == pytest.approx((0.1, 0.0, 0.02), abs=1e-9)
    corners = [moved(terrain, numbers(point)).tolist() for point in terrain.points]
    assert corners[:3] == [[-1.0, -0.5, 0.5], [0.0, -0.5, 0.6], [-1.0, 0.5, 0.8]] and len(corners) == 12
