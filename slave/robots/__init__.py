"""The robots there are: a table of drivers, imported only on use and extended by entry points."""

from difflib import get_close_matches
from importlib import import_module
from importlib.metadata import entry_points
from typing import cast

from weberlink.slave.robots.contract import RobotDriver

BUILT_IN = {
    "dynamixel": "weberlink.slave.robots.dynamixel.driver:DynamixelRobot",
    "mujoco": "weberlink.slave.robots.mjcf.driver:MujocoRobot",
    "point": "weberlink.slave.robots.point:PointRobot",
    "simulated": "weberlink.slave.robots.simulated:SimulatedRobot",
}

COMPUTED = frozenset({"mujoco", "point", "simulated"})
"""Those that move nothing real. All others count as hardware, those of other packages included."""


def drivers() -> dict[str, str]:
    """Name to "module:Class"; the built-in ones win over entry points of the group `weberlink.robots`."""
    return {entry.name: entry.value for entry in entry_points(group="weberlink.robots")} | BUILT_IN


def load(name: str) -> RobotDriver:
    """The driver class; raises ValueError for an unknown name, ImportError where its package is missing."""
    table = BUILT_IN if name in BUILT_IN else drivers()  # which has to look through all packages that are installed
    if name not in table:
        nearest = get_close_matches(name, table, n=1, cutoff=0.0)
        raise ValueError(
            f"driver: no robot is called {name!r}; nearest is {nearest[0]!r}, there are {', '.join(sorted(table))}"
        )
    module, _, attribute = table[name].partition(":")
    return cast(RobotDriver, getattr(import_module(module), attribute))


def is_hardware(name: str) -> bool:
    """Whether a driver of this name may move something real."""
    return name not in COMPUTED
