"""Robots and arms that MuJoCo computes."""
