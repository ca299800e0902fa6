"""Vectors for the tests of control: what hypothesis draws them from, and what is computed with them."""

from itertools import pairwise
from math import sqrt

from hypothesis import strategies as st

from weberlink.geometry.vector import Vector


def vectors(most: float) -> st.SearchStrategy[Vector]:
    """Components from -most to most."""
    component = st.floats(-most, most)
    return st.tuples(component, component, component)


forces = vectors(30.0)
"""[N]"""
positions = vectors(0.1)
"""[m]"""
steps = vectors(0.002)
"""From one tick to the next [m]."""


def dot(a: Vector, b: Vector) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def norm(a: Vector) -> float:
    return sqrt(dot(a, a))


def add(a: Vector, b: Vector) -> Vector:
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


def subtract(a: Vector, b: Vector) -> Vector:
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


def scale(a: Vector, by: float) -> Vector:
    return (a[0] * by, a[1] * by, a[2] * by)


def largest_step(values: list[Vector]) -> float:
    """Longest difference between neighbours."""
    return max((norm(subtract(b, a)) for a, b in pairwise(values)), default=0.0)
