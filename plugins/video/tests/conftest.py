"""The two homes behind NATs of the guest `anywhere`."""

from plugins.anywhere.tests.conftest import internet

__all__ = ["internet"]
