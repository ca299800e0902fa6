"""A robot from any MJCF file, computed by MuJoCo. `driver` and `options` import MuJoCo when a robot is built."""
