"""A rigid tool of several haptic points: force and torque of a scene about its tip."""

from collections.abc import Sequence
from copy import deepcopy

from weberlink.geometry.rotation import IDENTITY, Quaternion, turned, unit_quaternion
from weberlink.geometry.vector import ZERO, Vector
from weberlink.slave.scenes.scene import Scene


class Tool:
    """f = sum of f_i, torque = sum of r_i x f_i about the tip, with r_i from the tip to the point i, tool frame [m].

    Each point has a proxy and a friction memory of its own, hence a copy of the scene, of which the tool becomes the
    only user. An edge of the scene between two points is not felt.
    """

    def __init__(self, points: Sequence[Vector], scene: Scene) -> None:
        self._points = self._levers = tuple(points)
        self._orientation = IDENTITY
        self._scenes = (scene, *(deepcopy(scene) for _ in self._points[1:]))

    def reset(self) -> None:
        """Return to the identity orientation and forget all contacts."""
        self._orientation, self._levers = IDENTITY, self._points
        for scene in self._scenes:
            scene.reset()

    def point(self, orientation: Quaternion) -> None:
        """Set the orientation, from the tool frame to that of the scene; ValueError keeps the last one."""
        if orientation != self._orientation:
            held = unit_quaternion(orientation)
            if held is None:
                raise ValueError(f"point: commanded an orientation that is none: {orientation}")
            self._orientation, self._levers = orientation, tuple([turned(held, point) for point in self._points])

    def wrench(self, tip: Vector, dt: float) -> tuple[Vector, Vector]:
        """Force [N] and torque about the tip [N m] of the scene on the tool at `tip`, scene frame, `dt` after the last
        call.
        """
        fx = fy = fz = tx = ty = tz = 0.0
        for (x, y, z), scene in zip(self._levers, self._scenes, strict=True):
            force = scene.force((tip[0] + x, tip[1] + y, tip[2] + z), dt)
            if force == ZERO:
                continue
            a, b, c = force
            fx, fy, fz = fx + a, fy + b, fz + c
            tx, ty, tz = tx + y * c - z * b, ty + z * a - x * c, tz + x * b - y * a
        return (fx, fy, fz), (tx, ty, tz)
