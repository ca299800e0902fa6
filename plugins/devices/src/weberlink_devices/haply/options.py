"""Options of the driver `haply_2diy`, and the version of the device with their changes."""

from dataclasses import replace
from typing import Annotated, Literal

from pydantic import Field

from weberlink.master.devices.hardware_device import ForceOptions, PortOptions, Reply, Stiffness
from weberlink_devices.haply.board import CLOCKWISE, COUNTER_CLOCKWISE
from weberlink_devices.haply.linkage import MOST_TORQUE_N_M, VERSIONS, HaplyVersion

Direction = Literal["cw", "ccw"]
Directions = tuple[Direction, Direction]
Turn = Annotated[float, Field(ge=-360.0, le=360.0)]
Counts = Annotated[float, Field(gt=0.0, le=1e6)]


class HaplyOptions(ForceOptions, PortOptions):
    """Options of `haply_2diy`. A pair is of motor, arm or encoder 1 and 2."""

    version: Literal["v3", "v2", "pantograph"] = Field(
        default="v3", description="v3: plastic; v2: metal plate; pantograph: their forerunner"
    )
    home: Literal["kept", "start"] = Field(
        default="kept",
        description="kept: the handle is at its starting place when it is first used after it was plugged in; "
        "start: whenever a session begins",
    )
    home_deg: tuple[Turn, Turn] | None = Field(
        default=None, description="angles of the arms at the starting place; those of the version if not given"
    )
    motor_directions: Directions | None = Field(default=None, description="those of the version if not given")
    encoder_directions: Directions | None = Field(default=None, description="those of the version if not given")
    counts_per_turn: tuple[Counts, Counts] | None = Field(
        default=None, description="of the encoders; those of the version if not given"
    )
    whole_counts: bool = Field(
        default=True, description="only whole counts of the encoders are answers, as the known firmwares have it"
    )
    origin_m: tuple[float, float] | None = Field(
        default=None,
        description="becomes (0, 0); in the frame of the linkage; the middle of the workspace if not given",
    )
    torque_limit_n_m: float = Field(default=MOST_TORQUE_N_M, gt=0.0, le=MOST_TORQUE_N_M, description="of either motor")
    torque_gain: float = Field(default=1.0, gt=0.0, le=10.0, description="what the board is told for each newton metre")
    force_n: float = Field(default=2.0, gt=0.0, le=10.0, description="largest force; more is cut to it")
    stiffness_n_m: Stiffness = Field(default=300.0, description="stiffest wall; no figure has been published")
    reply_ms: Reply = 10.0


DIRECTIONS = {"cw": CLOCKWISE, "ccw": COUNTER_CLOCKWISE}


def version_of(options: HaplyOptions) -> HaplyVersion:
    """The published version with the changes of the options."""
    version = VERSIONS[options.version]
    board = version.board
    turns = [DIRECTIONS[name] for name in options.motor_directions or ()] or [each.direction for each in board.motors]
    spins = [DIRECTIONS[name] for name in options.encoder_directions or ()]
    spins = spins or [each.direction for each in board.encoders]
    counts = options.counts_per_turn or [each.counts_per_turn for each in board.encoders]
    motors = [each._replace(direction=turn) for each, turn in zip(board.motors, turns, strict=True)]
    encoders = [
        each._replace(direction=spin, counts_per_turn=count)
        for each, spin, count in zip(board.encoders, spins, counts, strict=True)
    ]
    board = replace(
        board,
        motors=(motors[0], motors[1]),
        encoders=(encoders[0], encoders[1]),
        home_deg=options.home_deg or board.home_deg,
        whole_counts=options.whole_counts,
    )
    return replace(version, board=board)
