"""Checks of this host: `weberlink doctor`."""
