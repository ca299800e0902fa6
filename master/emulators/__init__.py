"""Emulated haptic devices."""
