"""Offline: recorded signals through the codec, whole systems in virtual time, and the figures of a session."""
