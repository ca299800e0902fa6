"""The fitted surface near a point: a round piece of a plane or of a sphere, as triangles."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from weberlink.geometry.vector import Vector

Array = NDArray[np.float64]

RINGS, SPOKES = 6, 24
PLANE, SPHERE = 2, 3
"""Values of `model` in a telemetry record."""


def patch(record: Any, point: Vector, reach: float) -> Array | None:
    """Vertices of the piece around a point, rings from the middle out.

    Args:
        record: of a side; `model`, `surface` and `surface_size` say what was fitted. A plane with the unit normal n and
            the offset d holds the points p with n.p + d = 0.
        point: a place beside the surface [m].
        reach: how far the piece goes along the surface [m].

    Returns:
        Shape ((RINGS + 1) * SPOKES, 3) [m], in the order of `TRIANGLES`; None if nothing, or no surface, was fitted.
    """
    kind, fitted, size = int(record["model"]), np.array(record["surface"], float), float(record["surface_size"])
    if kind not in (PLANE, SPHERE) or not np.isfinite(fitted).all() or not np.isfinite(size):
        return None
    here = np.asarray(point, float)
    normal = fitted if kind == PLANE else here - fitted
    length = float(np.linalg.norm(normal))
    if not length > 0.0 or (kind == SPHERE and size == 0.0):
        return None
    normal = normal / length
    first, second = _across(normal)
    if kind == PLANE:
        arcs = np.linspace(0.0, reach, RINGS + 1)
        middle, along, out = here - (normal @ here + size) * normal, np.zeros_like(arcs), arcs
    else:
        radius = abs(size)
        arcs = np.linspace(0.0, min(reach, np.pi * radius), RINGS + 1)
        middle, along, out = fitted, radius * np.cos(arcs / radius), radius * np.sin(arcs / radius)
    turns = 2.0 * np.pi * np.arange(SPOKES) / SPOKES
    spokes = np.cos(turns)[:, None] * first + np.sin(turns)[:, None] * second
    rings: Array = middle + along[:, None, None] * normal + out[:, None, None] * spokes
    return rings.reshape(-1, 3)


def _triangles() -> list[int]:
    """Places of the corners of all triangles between the rings."""
    corners: list[int] = []
    for ring in range(RINGS):
        for spoke in range(SPOKES):
            a, b = ring * SPOKES + spoke, ring * SPOKES + (spoke + 1) % SPOKES
            corners += [a, a + SPOKES, b, b, a + SPOKES, b + SPOKES]
    return corners


TRIANGLES = _triangles()


def _across(normal: Array) -> tuple[Array, Array]:
    """Two unit vectors at right angles to a unit vector, and to each other."""
    helper = np.array((1.0, 0.0, 0.0) if abs(normal[0]) < 0.7 else (0.0, 1.0, 0.0))
    first = np.cross(helper, normal)
    first /= np.linalg.norm(first)
    return first, np.cross(normal, first)
