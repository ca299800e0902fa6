"""Figures of a session, computed from the telemetry of its two sides."""
