"""Recordings: the records of a session in one MCAP file, written by a process of its own and read back.

Needs the library `mcap` (extra: recording), so nothing outside imports it unless a recording is asked for.
"""
