"""The file of a session with pictures."""
