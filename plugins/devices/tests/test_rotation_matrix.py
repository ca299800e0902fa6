"""Rotation matrices of devices, and matrices that are none."""

from math import inf, nan

import pytest
from hypothesis import given, strategies as st

from tests.geometry.test_rotation import by_matrix, units
from weberlink.geometry.rotation import Quaternion, angle_between
from weberlink.geometry.vector import ZERO, Vector
from weberlink_devices.rotation_matrix import of_matrix


@given(units, st.floats(-1e-4, 1e-4))
def test_rotation_matrix_becomes_its_quaternion_to_its_precision(q: Quaternion, error: float) -> None:
    columns = [by_matrix(q, axis) for axis in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))]
    first, second, third = zip(*columns, strict=True)
    exact = of_matrix(first, second, third)
    assert exact is not None
    assert angle_between(exact, q) < 1e-7
    rounded = of_matrix((first[0] + error, first[1], first[2]), second, third)
    assert rounded is not None
    assert angle_between(rounded, q) <= 2.0 * abs(error) + 1e-7


Y, Z = (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
NO_ROTATIONS: dict[str, tuple[Vector, Vector, Vector]] = {
    "zero": (ZERO, ZERO, ZERO),
    "reflection": ((-1.0, 0.0, 0.0), Y, Z),
    "shear": ((1.0, 0.0, 0.0), (0.1, 1.0, 0.0), Z),
    "too long": ((1.1, 0.0, 0.0), (0.0, 1.1, 0.0), (0.0, 0.0, 1.1)),
    "nan": ((nan, 0.0, 0.0), Y, Z),
    "infinite": ((inf, 0.0, 0.0), Y, Z),
    "nan off the diagonal": ((1.0, 0.0, nan), Y, Z),
}


@pytest.mark.parametrize("name", NO_ROTATIONS)
def test_matrix_that_is_no_rotation_is_refused(name: str) -> None:
    assert of_matrix(*NO_ROTATIONS[name]) is None
