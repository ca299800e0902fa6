"""The conversation with the board: torques go out, angles come back. Blocks; runs in a worker's thread."""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from time import monotonic

from weberlink.geometry.vector import Vector
from weberlink.hardware.fault import BadReply, HardwareFault
from weberlink.hardware.guardian import Guardian
from weberlink.master.devices.contract import DeviceReading
from weberlink.master.devices.haply.board import RESET
from weberlink.master.devices.haply.fivebar import Pair, Unreachable, degrees, radians
from weberlink.master.devices.haply.frame import Frame
from weberlink.master.devices.haply.line import Forgotten, Line
from weberlink.master.devices.haply.track import Track
from weberlink.master.devices.haply.version import Version

SETUP_S = 0.5
"""How long a board may take for its first answer after it was set up."""
QUESTION_S = 0.05
"""How long it may take while nothing moves by its answers."""
QUESTIONS = 3
NEAR_HOME_DEG = 10.0
RESTARTED = (
    "the board was restarted and has forgotten where the arms are; put the handle at its starting place and start again"
)


@dataclass(frozen=True, slots=True)
class Conduct:
    """What the options say of the conversation.

    Args:
        version: the kind, with all that the options change of it.
        frame: of the device.
        torque_limit: of either motor [N m]; both are scaled down together, so that the force keeps its direction.
        torque_gain: what the board is told for each newton metre.
        reply: how long an answer may take [s].
        keep_home: whether a board that has been set up just so is left as it is.
    """

    version: Version
    frame: Frame
    torque_limit: float
    torque_gain: float
    reply: float
    keep_home: bool


class HaplyExchange:
    """Commands are forces [N] in the frame of the device.

    Args:
        find: gives the path of the port.
        conduct: by the options.
        guardian: takes the torque off when this process stops; None for a device without force.
    """

    def __init__(self, find: Callable[[], str], conduct: Conduct, guardian: Guardian | None = None) -> None:
        self.guardian = guardian
        self._find = find
        self._conduct = conduct
        self._board = conduct.version.board
        self._zero = self._board.torques(0.0, 0.0)
        self._line: Line | None = None
        self.start_afresh()

    def start_afresh(self) -> None:
        """A new session: nothing is known of where the arms are."""
        first, second = self._board.encoders
        resolution = radians((360.0 / first.counts_per_turn, 360.0 / second.counts_per_turn))
        self._track = Track(self._conduct.version.bar, radians(self._board.home_deg), resolution)
        self._angles: Pair | None = None

    def open(self) -> DeviceReading:
        """Zero torque comes first of all: a board holds that of a program which died.

        The first time of a session a board may be set up, which makes this the starting place. Later on it must
        still be.
        """
        self.close()
        self._line = line = Line(self._find(), self._board, self.guardian)
        try:
            reading = self._known(line) or self._set_up(line)
        except BadReply as reply:
            raise HardwareFault(f"{line.path}: {reply}") from None
        return reading

    def exchange(self, force: Vector) -> DeviceReading:
        line = self._line
        if line is None:
            raise HardwareFault("not open")
        try:
            return self._follow(line, self._message(force), self._conduct.reply)
        except Forgotten:
            raise HardwareFault(f"{line.path}: {RESTARTED}") from None

    def close(self) -> None:
        """Zero torque twice, each time with a while for the answer, which shows that it arrived."""
        line, self._line = self._line, None
        if line is None:
            return
        for message in (self._board.torques_off, self._zero):
            with suppress(HardwareFault):
                line.ask(message, QUESTION_S)
        line.close()

    def _known(self, line: Line) -> DeviceReading | None:
        """Where the tip is, if the board has been set up just so and may stay so; None if it must be set up.

        Raises:
            BadReply: no answer was good enough to tell.
            HardwareFault: it had been set up, and is not any more.
        """
        keeps = self._angles is not None or self._conduct.keep_home
        bad = BadReply("does not answer")
        for _ in range(QUESTIONS):
            try:
                if keeps:
                    return self._follow(line, self._zero, QUESTION_S)
                line.ask(self._zero, QUESTION_S)
            except Forgotten:
                break
            except BadReply as reply:
                bad = reply
            else:
                return None
        else:
            raise bad
        if self._angles is not None:
            raise HardwareFault(f"{line.path}: {RESTARTED}")
        return None

    def _set_up(self, line: Line) -> DeviceReading:
        line.tell(RESET)
        line.tell(self._board.setup)
        reading = self._follow(line, self._zero, SETUP_S)
        assert self._angles is not None
        angles, home = degrees(self._angles), self._board.home_deg
        if any(abs(a - b) > NEAR_HOME_DEG for a, b in zip(angles, home, strict=True)):
            raise HardwareFault(
                f"{line.path}: set up at {home} deg it answers {angles}; is another firmware on the board?"
            )
        return reading

    def _follow(self, line: Line, torques: bytes, patience: float) -> DeviceReading:
        angles, now = radians(line.ask(torques, patience)), monotonic()
        try:
            tip = self._track.follow(angles, line.asked_at, now)
        except BadReply:
            line.doubt()
            raise
        self._angles = angles
        return DeviceReading(now, self._conduct.frame.position(tip))

    def _message(self, force: Vector) -> bytes:
        """J^T F where the arms were last seen, within the limit; nothing where the linkage is singular."""
        planar = Frame.planar(force)
        if planar == (0.0, 0.0) or self._angles is None:
            return self._zero
        conduct = self._conduct
        try:
            first, second = conduct.version.bar.jacobian(self._angles).torques(planar)
        except Unreachable:
            return self._zero
        first, second = first * conduct.torque_gain, second * conduct.torque_gain
        most = max(abs(first), abs(second))
        share = conduct.torque_limit / most if most > conduct.torque_limit else 1.0
        return self._board.torques(first * share, second * share)
