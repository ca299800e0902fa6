"""The follower of a live WeberLink session as a robot of LeRobot: type `weberlink`."""

from lerobot_robot_weberlink.config_weberlink import WeberlinkRobotConfig
from lerobot_robot_weberlink.weberlink_robot import WeberlinkRobot

__all__ = ["WeberlinkRobot", "WeberlinkRobotConfig"]
