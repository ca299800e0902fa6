"""Emulated robots."""
