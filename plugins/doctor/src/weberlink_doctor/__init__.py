"""Checks whether a host, and the link to a waiting slave, suit a session: the command `doctor`."""
