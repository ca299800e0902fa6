"""The section `slave.cameras` of a file: the driver `video`, and its options."""

from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any, ClassVar, Final, Literal

from pydantic import Field

from weberlink.config.model import Name
from weberlink.config.settings import Settings
from weberlink_video.jpeg import MOST_PIXELS

PORT: Final = 47_001
LAST_PORT: Final = 65_535
MOST_CAMERAS: Final = 8
Side = Annotated[int, Field(ge=64, le=MOST_PIXELS, multiple_of=8)]


class SourceSettings(Settings):
    """One camera, or what stands for it."""

    name: Name = Field(description="on the page and in recordings")
    kind: Literal["device", "scene", "pattern"] = Field(
        default="device",
        description="`device`: a camera of Linux, or a file or pipe of JPEG pictures; `scene`: the model of a robot "
        "that MuJoCo simulates; `pattern`: a test picture that shows its own time",
    )
    device: Path = Field(default=Path("/dev/video0"), description="of the kind `device`; its pictures are not decoded")
    size: tuple[Side, Side] = Field(default=(640, 480), description="width and height [pixels]")
    rate_hz: float = Field(default=30.0, ge=0.1, le=240, description="pictures in a second, at most")
    quality: int = Field(default=75, ge=1, le=95, description="of the JPEG that is made of a scene or a pattern")


class VideoOptions(Settings):
    """Options of `video`."""

    sources: tuple[SourceSettings, ...] = Field(min_length=1, max_length=MOST_CAMERAS, description="the cameras")
    port: int = Field(
        default=PORT,
        ge=1,
        le=LAST_PORT,
        description="UDP port of the pictures on the robot's host; each host that watches takes the next one",
    )
    watchers: int = Field(
        default=1,
        ge=0,
        le=8,
        description="hosts that may watch at once beside the operator's (`weberlink watch`); equal in both files",
    )
    most_kbit_s: float = Field(
        default=20_000.0,
        ge=100,
        le=1e6,
        description="bandwidth of all pictures, at most; they take less where the link is slower, and yield to it",
    )

    def contradictions(self) -> Iterator[str]:
        names = [source.name for source in self.sources]
        if len(set(names)) < len(names):
            yield "sources: two of them have the same name"
        if self.port + self.watchers > LAST_PORT:
            yield f"port: {self.watchers} watchers take the ports behind it, of which {LAST_PORT} is the last"


class Video:
    """The camera driver `video` (`weberlink.config.cameras`)."""

    Options: ClassVar[type[VideoOptions]] = VideoOptions
    MODULE: ClassVar[str] = "weberlink_video.process"

    @staticmethod
    def preview(robot: str) -> dict[str, Any]:
        """Options for who tries a robot of this driver: its scene, or a test picture."""
        shown = {"name": "robot", "kind": "scene"} if robot == "mujoco" else {"name": "test", "kind": "pattern"}
        return {"sources": [shown | {"size": [320, 240], "rate_hz": 15}]}
