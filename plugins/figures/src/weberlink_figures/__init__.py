"""Figures, verdict, report and log of a session, and running sessions as other programs see them."""
