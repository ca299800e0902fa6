"""Options of the robot."""

from dataclasses import dataclass, field

from lerobot.cameras import CameraConfig
from lerobot.robots.config import RobotConfig


@RobotConfig.register_subclass("weberlink")
@dataclass(kw_only=True)
class WeberlinkRobotConfig(RobotConfig):
    """Which live session of this host, and what of it."""

    session: str | None = None
    """Process id of the session's launcher, as `weberlink monitor` shows it; None for the only session."""
    observe: bool = False
    """A person leads the session, and LeRobot only looks on: actions move nothing. Else the session's leader must be a
    `remote_leader`, which LeRobot leads."""
    use_degrees: bool = True
    """Joints in degrees; else -100 to 100 over their range. A gripper is always 0 to 100."""
    torque: bool = True
    """Observe the torques of the environment too [N m]."""
    force_window: int = 0
    """Observe the torques of so many newest ticks too, each as a number: 34 for all of 30 Hz at 1 kHz."""
    cameras: dict[str, CameraConfig] = field(default_factory=dict)

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0 <= self.force_window <= 1000:
            raise ValueError(f"force_window: expected 0 to 1000 ticks, not {self.force_window}")
