"""Haptic devices, six-axis mice and gamepads, each with its emulator beside its driver."""
