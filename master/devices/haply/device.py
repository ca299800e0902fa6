"""The driver `haply_2diy`: a planar device with two motors, from the linkage's frame to that of the operator."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Annotated, ClassVar, Literal

from pydantic import BaseModel, ConfigDict, Field

from weberlink.hardware.discovery import PluggedDevice, UsbId, only, serial_ports
from weberlink.hardware.guardian import Guardian
from weberlink.master.devices.contract import DeviceSpec
from weberlink.master.devices.haply.board import (
    CLOCKWISE,
    COUNTER_CLOCKWISE,
    RESET,
    BoardEncoder,
    BoardMotor,
    HaplyBoard,
)
from weberlink.master.devices.haply.exchange import HaplyExchange
from weberlink.master.devices.haply.linkage import MOST_TORQUE_N_M, VERSIONS, HaplyFrame, HaplyVersion
from weberlink.master.devices.threaded_device import ThreadedDevice, fingerprint

NAME = "haply_2diy"
NO_FORCE = f"no force: signs not checked; run: weberlink device test {NAME}"
NO_WATCHDOG = (
    "no watchdog: where this host loses its power or the cable is pulled, its board holds the last force until it is "
    "switched off"
)
FLAT_M = 0.001
"""Half the thickness of the workspace: z never moves, but a box has a thickness."""
BAD_REPLIES = 10
"""In a row are a fault; there is no force from the first on."""

Direction = Literal["cw", "ccw"]
Directions = tuple[Direction, Direction]
Turn = Annotated[float, Field(ge=-360.0, le=360.0)]
Counts = Annotated[float, Field(gt=0.0, le=1e6)]


class HaplyOptions(BaseModel):
    """Options of `haply_2diy`. A pair is of motor, arm or encoder 1 and 2."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    port: str | None = Field(default=None, description="of the board; the only Arduino plugged in if not given")
    reconnect_s: float = Field(default=0.0, ge=0.0, le=60.0, description="how long to look for it when it is gone")
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
        default=True,
        description="only whole counts of the encoders are answers, as the known firmwares have it",
    )
    origin_m: tuple[float, float] | None = Field(
        default=None,
        description="becomes (0, 0); in the frame of the linkage; the middle of the workspace if not given",
    )
    torque_limit_n_m: float = Field(default=MOST_TORQUE_N_M, gt=0.0, le=MOST_TORQUE_N_M, description="of either motor")
    torque_gain: float = Field(default=1.0, gt=0.0, le=10.0, description="what the board is told for each newton metre")
    force_n: float = Field(default=2.0, gt=0.0, le=10.0, description="largest force; more is cut to it")
    stiffness_n_m: float = Field(default=300.0, gt=0.0, description="stiffest wall; no figure has been published")
    reply_ms: float = Field(default=10.0, ge=1.0, le=100.0, description="how long an answer may take")
    signs_checked: str | None = Field(
        default=None, description="what `weberlink device test` prints once the directions are right; no force without"
    )


class HaplyDevice(ThreadedDevice):
    """x toward the operator, y to the operator's right, z up and always 0; the origin in the middle of the workspace.

    The board has no watchdog: it holds the last torque for as long as it has power. The thread sends zero when the tick
    falls silent, on every fault and at the end; a guardian process sends it when this process stops or dies.
    """

    Options: ClassVar[type[BaseModel]] = HaplyOptions
    USB: ClassVar[tuple[UsbId, ...]] = (UsbId(0x2341, 0x804D), UsbId(0x2341, 0x824D), UsbId(0x2341, 0x003E))
    """Arduino Zero and Due by their native ports, as which the boards of the device come; so does any other of them."""
    SIGN_OPTIONS: ClassVar[Mapping[str, str]] = dict.fromkeys("xy", "encoder_directions (or version, or home_deg)")

    def __init__(self, options: HaplyOptions, tick_period: float) -> None:
        self._options = options
        version = _version(options)
        frame = HaplyFrame(options.origin_m or version.center)
        armed = options.signs_checked == self.fingerprint(options)
        zero = version.board.torques(0.0, 0.0)
        self._exchange = HaplyExchange(
            self._port,
            version,
            frame,
            Guardian(version.board.torques_off, (zero, RESET, version.board.setup)) if armed else None,
            torque_limit=options.torque_limit_n_m,
            torque_gain=options.torque_gain,
            reply=options.reply_ms * 1e-3,
            keep_home=options.home == "kept",
        )
        super().__init__(
            _spec(options, version, frame, 1.0 / tick_period, armed),
            self._exchange,
            tick_period,
            bad_replies=BAD_REPLIES,
            reconnect=options.reconnect_s,
        )

    @classmethod
    def plugged(cls) -> list[PluggedDevice]:
        """Boards that may be one: an Arduino does not say what hangs on it."""
        return serial_ports(cls.USB)

    @classmethod
    def fingerprint(cls, options: HaplyOptions) -> str:
        """Of all that a wrong sign could come from, as 8 hexadecimal digits."""
        board = _version(options).board
        turns = [each.direction for each in (*board.motors, *board.encoders)]
        return fingerprint(f"{NAME} {options.version} {turns} {board.home_deg}")

    def open(self, now: float) -> None:
        self.close()
        self._exchange.start_afresh()
        super().open(now)

    def _port(self) -> str:
        if self._options.port is not None:
            return self._options.port
        return only(self.plugged(), f"{NAME} (an Arduino board)", "master.device.port").path


def _version(options: HaplyOptions) -> HaplyVersion:
    """The kind with what the options change."""
    version = VERSIONS[options.version]
    board = version.board
    turns = options.motor_directions or [_named(each.direction) for each in board.motors]
    spins = options.encoder_directions or [_named(each.direction) for each in board.encoders]
    counts = options.counts_per_turn or [each.counts_per_turn for each in board.encoders]
    motors = [BoardMotor(each.port, _direction(turn)) for each, turn in zip(board.motors, turns, strict=True)]
    encoders = [
        BoardEncoder(each.port, _direction(spin), count)
        for each, spin, count in zip(board.encoders, spins, counts, strict=True)
    ]
    board = HaplyBoard(
        (motors[0], motors[1]), (encoders[0], encoders[1]), options.home_deg or board.home_deg, options.whole_counts
    )
    return replace(version, board=board)


def _named(direction: int) -> Direction:
    return "ccw" if direction == COUNTER_CLOCKWISE else "cw"


def _direction(name: Direction) -> int:
    return COUNTER_CLOCKWISE if name == "ccw" else CLOCKWISE


def _spec(options: HaplyOptions, version: HaplyVersion, frame: HaplyFrame, rate: float, armed: bool) -> DeviceSpec:
    x, y, _ = frame.position(version.center)
    across, along = version.reach
    when = "before every session" if options.home == "start" else "when it is first used after it was plugged in"
    return DeviceSpec(
        name=NAME,
        axes="xy",
        force_n=options.force_n if armed else 0.0,
        stiffness_n_m=options.stiffness_n_m,
        workspace_m=((x - along, y - across, -FLAT_M), (x + along, y + across, FLAT_M)),
        rate_hz=rate,
        force_feedback=armed,
        note=f"{NO_WATCHDOG if armed else NO_FORCE}; the handle must be at its starting place {when}",
    )
