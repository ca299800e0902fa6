"""The driver of the maker's library, against a stand-in that is compiled here."""

judge_name = "plugins.devices.tests.force_dimension.judge"
"""Imported by a process of its own alone: it loads the library on import."""
