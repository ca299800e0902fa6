"""The kinds of the device: published numbers, as far as there are any. Pure."""

from dataclasses import dataclass

from weberlink.master.devices.haply.board import CLOCKWISE, COUNTER_CLOCKWISE, Board, Encoder, Motor
from weberlink.master.devices.haply.fivebar import FiveBar, Pair

MOST_TORQUE_N_M = 0.123
"""What the firmware cuts the torque of a motor to, and full duty stands for.

The same in all that the vendor has published (HaplyHaptics/Haply-Arduino-Firmware-Versions, `MAX_TORQUE`): for the Due
board (1.5 of July 2017), the M3 and the M0 (1.5 and 0.3 of December 2018).
"""


@dataclass(frozen=True, slots=True)
class Version:
    """A kind of the device.

    Args:
        bar: the linkage.
        board: what hangs on which port, and the angles of the arms at the starting place.
        center: middle of the workspace, in the frame of the linkage [m].
        reach: half the workspace, along x and y [m]: until the linkage is stretched out, and toward the motors as far
            as the starting place.
    """

    bar: FiveBar
    board: Board
    center: Pair
    reach: Pair


_CW, _CCW = CLOCKWISE, COUNTER_CLOCKWISE

VERSIONS = {
    "v3": Version(
        bar=FiveBar(0.07, 0.09, 0.038),
        board=Board(
            motors=(Motor(2, _CCW), Motor(1, _CCW)),
            encoders=(Encoder(2, _CCW, 4880.0), Encoder(1, _CCW, 4880.0)),
            home_deg=(168.0, 12.0),
        ),
        center=(0.019, 0.097),
        reach=(0.138, 0.063),
    ),
    "v2": Version(
        bar=FiveBar(0.07, 0.09, 0.0),
        board=Board(
            motors=(Motor(2, _CCW), Motor(1, _CW)),
            encoders=(Encoder(2, _CCW, 10752.0), Encoder(1, _CW, 10752.0)),
            home_deg=(241.0, -61.0),
        ),
        center=(0.0, 0.091),
        reach=(0.16, 0.07),
    ),
    "pantograph": Version(
        bar=FiveBar(0.05, 0.07, 0.02),
        board=Board(
            motors=(Motor(1, _CW), Motor(2, _CW)),
            encoders=(Encoder(1, _CW, 13824.0), Encoder(2, _CW, 13824.0)),
            home_deg=(180.0, 0.0),
        ),
        center=(0.01, 0.078),
        reach=(0.105, 0.043),
    ),
}
"""v3 of plastic, v2 with the metal plate, and their forerunner; from the vendor's libraries and example programs."""
