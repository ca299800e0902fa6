"""Whole systems: configuration, composition, daemons, virtual time and scoring."""
