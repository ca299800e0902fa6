"""Vectors, quaternions and rotations as plain tuples of floats."""
