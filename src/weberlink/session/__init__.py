"""Sessions: what a file composes, the side loop, daemons and virtual time."""
