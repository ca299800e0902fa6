"""Fixtures of the tests of whole systems."""

from tests.system.namespaces import hosts

__all__ = ["hosts"]
