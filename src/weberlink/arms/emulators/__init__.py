"""Emulated motors of arms on their buses."""
