"""A camera of LeRobot whose images count up; LeRobot finds `TrialCamera` by the place of its configuration."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from lerobot.cameras import Camera, CameraConfig
from numpy.typing import NDArray


@CameraConfig.register_subclass("trial")
@dataclass(kw_only=True)
class TrialCameraConfig(CameraConfig):
    fps: int | None = 30
    width: int | None = 64
    height: int | None = 48


class TrialCamera(Camera):
    """Image number n has the value n modulo 256 everywhere."""

    def __init__(self, config: TrialCameraConfig) -> None:
        super().__init__(config)
        self._images: int | None = None

    @property
    def is_connected(self) -> bool:
        return self._images is not None

    @staticmethod
    def find_cameras() -> list[dict[str, Any]]:
        return []

    def connect(self, warmup: bool = True) -> None:
        self._images = 0

    def read(self) -> NDArray[Any]:
        assert self._images is not None
        self._images = (self._images + 1) % 256
        return np.full((self.height or 0, self.width or 0, 3), self._images, np.uint8)

    def async_read(self, timeout_ms: float = 200.0) -> NDArray[Any]:
        return self.read()

    def read_latest(self, max_age_ms: int = 500) -> NDArray[Any]:
        return self.read()

    def disconnect(self) -> None:
        self._images = None
