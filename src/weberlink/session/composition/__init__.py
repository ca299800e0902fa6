"""Builds the two sides of a configuration and the link between them; a daemon imports its own side only."""
