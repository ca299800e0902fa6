"""A robot out of any MJCF file, computed by MuJoCo: loading, position control, force sensing, and the driver.

MuJoCo is an optional package: only `driver` and `options` may be imported without it.
"""
