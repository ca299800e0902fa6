"""MJCF files of the arms; each names its source and what is not public."""

from pathlib import Path
from typing import Final

_HERE: Final = Path(__file__).parent
KOCH_FOLLOWER, KOCH_LEADER, OMX_LEADER, OPEN_MANIPULATOR_X, SO101 = (
    _HERE / f"{name}.xml" for name in ("koch_follower", "koch_leader", "omx_leader", "open_manipulator_x", "so101")
)
