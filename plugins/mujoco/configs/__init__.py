"""Sessions, and the models that they name."""

OTHERS = {"mujoco/": "MuJoCo models of the mujoco files"}
