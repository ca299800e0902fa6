"""The table of follower arms, extended by entry points of the group `weberlink.followers`."""

from weberlink.arms.contract import FollowerDriver
from weberlink.registry import Registry

BUILT_IN = {
    "koch_follower": "weberlink.slave.robots.dynamixel_follower:KochFollower",
    "mujoco_arm": "weberlink.slave.robots.mujoco_arm:MujocoArm",
    "open_manipulator_x": "weberlink.slave.robots.dynamixel_follower:OpenManipulatorX",
    "so101_follower": "weberlink.slave.robots.so101_follower:So101Follower",
}
FOLLOWERS: Registry[FollowerDriver] = Registry("follower arm", BUILT_IN, "weberlink.followers")

drivers = FOLLOWERS.places


def load(name: str) -> FollowerDriver:
    """The driver class; raises ValueError for an unknown name, ImportError where its package is missing."""
    try:
        return FOLLOWERS.load(name)
    except ValueError as error:
        raise ValueError(f"driver: {error}") from None
