"""The tables of robot drivers and of follower arms, extended by the entry points of their groups."""

from weberlink.registry import Driver, Registry

BUILT_IN = {
    "point": "weberlink.slave.robots.computed:PointRobot",
    "simulated": "weberlink.slave.robots.simulated:SimulatedRobot",
}


def _check(name: str, entry: object) -> None:
    if not callable(entry):
        raise ValueError(f"weberlink.robots: {name} is not a driver class")  # noqa: TRY004 - wrong name


ROBOTS: Registry[Driver] = Registry("robot", BUILT_IN, "weberlink.robots", _check)
FOLLOWERS: Registry[Driver] = Registry("follower arm", {}, "weberlink.followers")
