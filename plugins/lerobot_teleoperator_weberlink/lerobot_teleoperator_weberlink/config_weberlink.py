"""Options of the teleoperator."""

from dataclasses import dataclass

from lerobot.teleoperators.config import TeleoperatorConfig


@TeleoperatorConfig.register_subclass("weberlink")
@dataclass(kw_only=True)
class WeberlinkTeleoperatorConfig(TeleoperatorConfig):
    """Which live session of this host, and what of it."""

    session: str | None = None
    """Process id of the session's launcher, as `weberlink monitor` shows it; None for the only session."""
    side: str = "master"
    """`master`: the leader's measured angles. `slave`: the follower's commands, where the master is on another host."""
    use_degrees: bool = True
    """Joints in degrees; else -100 to 100 over their range. A gripper is always 0 to 100."""

    def __post_init__(self) -> None:
        if self.side not in ("master", "slave"):
            raise ValueError(f"side: expected master or slave, not {self.side}")
