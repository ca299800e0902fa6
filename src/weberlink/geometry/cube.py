"""The cube about the origin that devices and virtual robots move in."""

from weberlink.geometry.vector import Vector


def cube(half_edge: float) -> tuple[Vector, Vector]:
    """Lower and upper corner."""
    return (-half_edge, -half_edge, -half_edge), (half_edge, half_edge, half_edge)


def check_home(home: Vector, half_edge: float) -> None:
    """See that a home position lies in the cube; raises ValueError naming both. All in metres."""
    if max(map(abs, home)) > half_edge:
        raise ValueError(f"home_m: expected a point within the workspace of +-{half_edge} m, got {home}")
