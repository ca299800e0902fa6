"""Measures the link to a waiting slave, and names settings that suit it: `weberlink doctor FILE --link PEER`."""
