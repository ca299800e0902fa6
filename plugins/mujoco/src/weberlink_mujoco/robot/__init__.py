"""The robot `mujoco`. `driver` and `options` import MuJoCo when a robot is built."""
