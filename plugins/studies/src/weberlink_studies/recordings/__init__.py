"""Recordings of people and robots in contact, from public sources, as part of the package."""

from weberlink_studies.recordings.catalogue import SOURCES, Source, has_surface, load, names, source_of

__all__ = ["SOURCES", "Source", "has_surface", "load", "names", "source_of"]
