"""Commissioning of a device or robot with a person: `weberlink device test`."""
