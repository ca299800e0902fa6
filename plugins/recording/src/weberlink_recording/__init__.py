"""Recordings: the records of a session in one MCAP file, written by a process of its own, read back and exported."""
