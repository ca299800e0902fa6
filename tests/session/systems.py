"""Whole systems in virtual time for tests: a configuration with overrides."""

from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from weberlink.config import Configuration, load
from weberlink.config.loading import Part
from weberlink.session.simulation import Simulation, build_simulation

CONFIGS = Path(__file__).parents[2] / "configs"
ARMS = Path(__file__).parents[1] / "arms" / "arms.yaml"  # two computed arms; no file of arms is shipped with the kernel
HAS_ARMS = find_spec("weberlink_mujoco") is not None  # whether what computes them is installed


def configuration(
    *overrides: str, file: str | Path = "loopback.yaml", device: Any = None, robot: Any = None
) -> Configuration:
    """A shipped file with overrides; `device` and `robot` are classes to be built in place of the drivers'."""
    loaded = load(CONFIGS / file, overrides)
    if device is not None:
        assert loaded.device is not None
        loaded = replace(loaded, device=Part(device, loaded.device.options))
    if robot is not None:
        assert loaded.robot is not None
        loaded = replace(loaded, robot=Part(robot, loaded.robot.options))
    return loaded


def system(*overrides: str, **parts: Any) -> Simulation:
    return build_simulation(configuration(*overrides, **parts))
