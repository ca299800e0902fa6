"""The dialogue with the Haply board: torques out, angles in.

No byte of an answer says which question it belongs to, and there is no checksum: a lost byte shows in the length, in
the device id, or in angles that the arms cannot have.
"""

from collections.abc import Callable
from contextlib import suppress
from math import inf
from time import monotonic

from weberlink.geometry.vector import Vector
from weberlink.hardware.fault import BadReply, HardwareFault
from weberlink.hardware.guardian import Guardian
from weberlink.hardware.serial_port import SerialPort
from weberlink.master.devices.contract import DeviceReading
from weberlink_devices.haply.board import REPLY_SIZE, RESET, HaplyBoard, Pair
from weberlink_devices.haply.linkage import HaplyFrame, HaplyVersion, PlanarFiveBar, Unreachable, degrees, radians
from weberlink_devices.haply.options import HaplyOptions

SETTLING_S = 0.1
"""Silence after which an owed answer counts as lost [s]."""
LEAST_SIZE = REPLY_SIZE - 1
"""Size of an answer that lost a byte."""
GAP_S = 0.01
"""Longest wait for the rest of an answer [s]: it leaves the board in one packet."""
MUTE_MOST = 2
"""Number of silent waits after which the board counts as mute."""
RECOVERY_S = 0.05
"""Longest wait for the answer after a bad one [s]: a late answer is bad too, but no longer owed."""


class Forgotten(HardwareFault):
    """The board does not know this id: it was never set up like this, or restarted since."""


class HaplyLine:
    """An open port to the board; its guardian is None where it never gets a torque.

    A late answer would be taken for the answer to the next question, and the positions would lag from then on. So after
    a bad answer the torque is taken off, and the next question waits until no answer is owed.
    """

    def __init__(self, path: str, board: HaplyBoard, guardian: Guardian | None = None) -> None:
        self._port = SerialPort(path, guardian=guardian)
        self._board = board
        self._guardian = guardian
        self._owed = 0
        self._heard = b""
        self._recovers = False
        self._mute = 0
        self.asked_at = 0.0
        """When the last question was sent [s]."""

    @property
    def path(self) -> str:
        return self._port.path

    def tell(self, message: bytes) -> None:
        """Send a message that has no answer."""
        self._port.write(message)

    def ask(self, torques: bytes, patience: float) -> Pair:
        """Command torques and get the angles [deg]; after a bad answer, first wait with the torque off.

        Raises:
            BadReply: no answer within `patience` [s], or one that cannot be.
            Forgotten: the board knows nothing of us.
            HardwareFault: the port is gone, or the board mute.
        """
        self._count_guardian()
        if self._owed:
            self._settle(patience)
        self._port.drain()
        self.asked_at = monotonic()
        self._port.write(torques)
        self._owed, self._heard = 1, b""
        self._listen(REPLY_SIZE, max(patience, RECOVERY_S) if self._recovers else patience)
        if not self._heard:
            self._recovers = True
            raise BadReply(f"no answer within {patience * 1e3:g} ms")
        try:
            angles = self._board.angles(self._heard)
        except BadReply:
            self._recovers = True
            raise
        self._owed, self._heard = 0, b""
        if self._recovers and (elapsed := monotonic() - self.asked_at) > patience:
            raise BadReply(f"answered after {elapsed * 1e3:.0f} ms instead of {patience * 1e3:g}")
        self._recovers = False
        return angles

    def doubt(self) -> None:
        """Reject the last answer: it was readable but is implausible."""
        self._owed, self._recovers = 1, True

    def close(self) -> None:
        self._port.close()

    def _settle(self, patience: float) -> None:
        """Take the torque off, and hear all that is owed, or nothing for a while."""
        self._port.write(self._board.torques_off)
        self._owed += 1
        self._count_guardian()  # it may have written until then
        # Late answers are as far apart as the messages were, which waited for `patience`, or in silence.
        quiet = patience + SETTLING_S * (1 + self._mute)
        while len(self._heard) < LEAST_SIZE * self._owed and (part := self._port.read(monotonic() + quiet)):
            self._heard += part
        if not self._heard:  # what is owed may still come: no question may be asked
            self._recovers = True
            self._mute += 1
            if self._mute >= MUTE_MOST:
                raise HardwareFault(f"{self.path}: does not answer")
            raise BadReply(f"no answer within {quiet * 1e3:.0f} ms to the message that takes the torque off")
        while more := self._port.read(monotonic() + GAP_S):  # what nobody owes
            self._heard += more
        owed, self._owed, self._mute = self._owed, 0, 0
        if len(self._heard) <= owed and self._heard == self._board.bare_reply * len(self._heard):
            raise Forgotten("the board does not know of this device")

    def _count_guardian(self) -> None:
        """The board answers the guardian's messages too."""
        if self._guardian is not None:
            self._owed += self._guardian.new_writes()

    def _listen(self, size: int, patience: float) -> None:
        end = until = monotonic() + patience
        while len(self._heard) < size and (part := self._port.read(until)):
            self._heard += part
            until = min(end, monotonic() + GAP_S) if len(self._heard) % REPLY_SIZE else end


FASTEST = 50.0
"""Fastest plausible arm [rad/s]; a hand at 1 m/s turns an arm of 7 cm at 14."""
WIDEST = 3.5
"""Largest angle of an arm from its starting place [rad]."""
STUCK_TRAVEL = 1.5
"""An encoder counts as broken when the other arm turns by this angle without a single count of it [rad]."""


class AngleValidator:
    """Checks the angles of one session for plausibility, from those at home on; all in rad."""

    def __init__(self, bar: PlanarFiveBar, home: Pair, resolution: Pair) -> None:
        self._bar = bar
        self._home = home
        self._resolution = resolution
        self._last: Pair | None = None
        self._asked_at = 0.0
        self._travel = [0.0, 0.0]

    def follow(self, angles: Pair, asked_at: float, now: float) -> Pair:
        """Accept angles [rad], and give the tip [m, frame of the linkage].

        They were measured some time between `asked_at` and `now` [s]: a host that stalls gets an answer late.

        Raises:
            BadReply: no posture is like this, or none that the arms could have come to since the last one.
            HardwareFault: an encoder has stood still for too long.
        """
        for number, (angle, home) in enumerate(zip(angles, self._home, strict=True), 1):
            if abs(angle - home) > WIDEST:
                raise BadReply(f"arm {number} at {angle:.2f} rad, out of its range: bytes were lost")
        try:
            tip = self._bar.tip(angles)
        except Unreachable as error:
            raise BadReply(f"{error}: bytes were lost, or the handle was not at its starting place") from None
        if self._last is not None:
            self._compare(angles, self._last, max(0.0, now - self._asked_at))
        self._last, self._asked_at = angles, asked_at
        for number, travel in enumerate(self._travel, 1):
            if travel > STUCK_TRAVEL:
                raise HardwareFault(
                    f"encoder {number} stands still though the other arm turned by {travel:.1f} rad; "
                    "check its cable, put the handle at its starting place and start again"
                )
        return tip

    def _compare(self, angles: Pair, last: Pair, elapsed: float) -> None:
        steps = [abs(angle - before) for angle, before in zip(angles, last, strict=True)]
        for number, (step, resolution) in enumerate(zip(steps, self._resolution, strict=True), 1):
            if step > FASTEST * elapsed + 1.5 * resolution:
                raise BadReply(f"arm {number} jumped by {step:.2f} rad within {elapsed * 1e3:.1f} ms: bytes were lost")
        for mine, other in ((0, 1), (1, 0)):
            moved = steps[mine] > 0.5 * self._resolution[mine]
            self._travel[mine] = 0.0 if moved else self._travel[mine] + steps[other]


SETUP_S = 0.5
"""Longest wait for the first answer after a setup [s]."""
QUESTION_S = 0.05
"""Longest wait for an answer while no control depends on it [s]."""
QUESTIONS = 3
NEAR_HOME_DEG = 10.0
RESTARTED = (
    "the board was restarted and has forgotten where the arms are; put the handle at its starting place and start again"
)


class HaplyExchange:
    """Commands are forces [N] in the frame of the device.

    Args:
        find: gives the path of the port.
        version: of the device, with the changes of the options.
        options: of the driver.
        guardian: of the board; None for a device without force.
    """

    def __init__(
        self, find: Callable[[], str], version: HaplyVersion, options: HaplyOptions, guardian: Guardian | None = None
    ) -> None:
        self.guardian = guardian
        self._find = find
        self._version = version
        self._options = options
        self._frame = HaplyFrame(options.origin_m or version.center)
        self._board = version.board
        self._zero = self._board.torques(0.0, 0.0)
        self._line: HaplyLine | None = None
        self.start_afresh()

    def start_afresh(self) -> None:
        """Begin a new session with unknown angles."""
        first, second = self._board.encoders
        resolution = radians((360.0 / first.counts_per_turn, 360.0 / second.counts_per_turn))
        self._track = AngleValidator(self._version.bar, radians(self._board.home_deg), resolution)
        self._angles: Pair | None = None

    def open(self) -> DeviceReading:
        """Connect, and command zero torque first: the board may still hold that of a program that died.

        The first connection of a session may set the board up, here and now; later ones require that setup.
        """
        self.close()
        self._line = line = HaplyLine(self._find(), self._board, self.guardian)
        try:
            return self._known(line) or self._set_up(line)
        except BadReply as reply:
            raise HardwareFault(f"{line.path}: {reply}") from None

    def exchange(self, force: Vector) -> DeviceReading:
        line = self._line
        if line is None:
            raise HardwareFault("not open")
        try:
            return self._follow(line, self._message(force), self._options.reply_ms * 1e-3)
        except Forgotten:
            raise HardwareFault(f"{line.path}: {RESTARTED}") from None

    def close(self) -> None:
        """Command zero torque twice and wait each time for the answer, which confirms it."""
        line, self._line = self._line, None
        if line is None:
            return
        for message in (self._board.torques_off, self._zero):
            with suppress(HardwareFault):
                line.ask(message, QUESTION_S)
        line.close()

    def _known(self, line: HaplyLine) -> DeviceReading | None:
        """The reading of a board that already has exactly this setup and may keep it; None if it must be set up.

        Raises:
            BadReply: no answer was good enough to tell.
            HardwareFault: it had been set up, and is not any more.
        """
        keeps = self._angles is not None or self._options.home == "kept"
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

    def _set_up(self, line: HaplyLine) -> DeviceReading:
        line.tell(RESET)
        line.tell(self._board.setup)
        reading = self._follow(line, self._zero, SETUP_S)
        angles, home = degrees(self._angles or (inf, inf)), self._board.home_deg
        if any(abs(a - b) > NEAR_HOME_DEG for a, b in zip(angles, home, strict=True)):
            raise HardwareFault(
                f"{line.path}: set up at {home} deg it answers {angles}; is another firmware on the board?"
            )
        return reading

    def _follow(self, line: HaplyLine, torques: bytes, patience: float) -> DeviceReading:
        angles, now = radians(line.ask(torques, patience)), monotonic()
        try:
            tip = self._track.follow(angles, line.asked_at, now)
        except BadReply:
            line.doubt()
            raise
        self._angles = angles
        return DeviceReading(now, self._frame.position(tip))

    def _message(self, force: Vector) -> bytes:
        """J^T F in the last pose, within the limit; zero where the linkage is singular."""
        planar = HaplyFrame.planar(force)
        if planar == (0.0, 0.0) or self._angles is None:
            return self._zero
        try:
            first, second = self._version.bar.jacobian(self._angles).torques(planar)
        except Unreachable:
            return self._zero
        gain, limit = self._options.torque_gain, self._options.torque_limit_n_m
        first, second = first * gain, second * gain
        most = max(abs(first), abs(second))
        share = limit / most if most > limit else 1.0
        return self._board.torques(first * share, second * share)
