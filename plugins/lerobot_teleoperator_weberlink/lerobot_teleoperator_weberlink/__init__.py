"""The leader of a live WeberLink session as a teleoperator of LeRobot: type `weberlink`."""

from lerobot_teleoperator_weberlink.config_weberlink import WeberlinkTeleoperatorConfig
from lerobot_teleoperator_weberlink.weberlink_teleoperator import WeberlinkTeleoperator

__all__ = ["WeberlinkTeleoperator", "WeberlinkTeleoperatorConfig"]
