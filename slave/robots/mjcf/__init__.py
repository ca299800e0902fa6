"""A robot from any MJCF file, computed by MuJoCo.

MuJoCo is optional: only `driver` and `options` can be imported without it, and `rotation` only if it is configured.
"""
