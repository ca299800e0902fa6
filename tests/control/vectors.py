"""Vectors for the tests of control, as hypothesis draws them, and the largest step of a signal."""

from itertools import pairwise

from hypothesis import strategies as st

from weberlink.geometry.vector import Vector, distance


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


def largest_step(values: list[Vector]) -> float:
    """Largest distance between neighbours."""
    return max((distance(a, b) for a, b in pairwise(values)), default=0.0)
