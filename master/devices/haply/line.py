"""Questions and answers over the port: which answer belongs to which question, where no byte of it says so.

Owns the order of things on the wire. Knows no linkage and no force.
"""

from time import monotonic

from weberlink.hardware.fault import BadReply, HardwareFault
from weberlink.hardware.guardian import Guardian
from weberlink.hardware.serial_port import SerialPort
from weberlink.master.devices.haply.board import REPLY_SIZE, Board
from weberlink.master.devices.haply.fivebar import Pair

SETTLING_S = 0.1
"""How long an answer that is owed is waited for before it counts as lost."""
LEAST_SIZE = REPLY_SIZE - 1
"""Of an answer on its way to which a byte got lost."""
GAP_S = 0.01
"""How long the rest of an answer is waited for once some of it is there: it leaves the board in one packet."""
MUTE_MOST = 2
"""How often nothing at all may come for so long."""
RECOVERY_S = 0.05
"""How long an answer after a bad one is waited for: it is late then, which is bad too, but is not owed any more."""


class Forgotten(HardwareFault):
    """The board knows no device of this id: it has never been set up so, or was restarted since."""


class Line:
    """An open port with the board at its other end.

    An answer that comes too late would be taken for that to the next question, and so would every one after it: the
    positions would lag for good. So after a bad answer the torque is taken off, and there is no next question until
    nothing is owed any more.

    Args:
        path: of the port.
        board: at the other end.
        guardian: of the board; None where it never gets a torque.

    Raises:
        HardwareFault: the port cannot be opened.
    """

    def __init__(self, path: str, board: Board, guardian: Guardian | None = None) -> None:
        self._port = SerialPort(path, guardian=guardian)
        self._board = board
        self._guardian = guardian
        self._owed = 0
        self._heard = b""
        self._recovers = False
        self._mute = 0
        self.asked_at = 0.0
        """When the last question went out [s]."""

    @property
    def path(self) -> str:
        return self._port.path

    def tell(self, message: bytes) -> None:
        """Something that is not answered."""
        self._port.write(message)

    def ask(self, torques: bytes, patience: float) -> Pair:
        """Command torques and get the angles [deg]; after a bad answer, with a while before in which the torque is off.

        Raises:
            BadReply: no answer within `patience` [s], or one that cannot be.
            Forgotten: the board knows nothing of us.
            HardwareFault: the port is gone, or the board mute.
        """
        has_written = self._guardian is not None and self._guardian.has_written()
        if self._owed or has_written:
            self._settle()
        self._port.drain()
        self.asked_at = monotonic()
        self._port.write(torques)
        self._owed, self._heard = 1, b""
        self._listen(REPLY_SIZE, max(patience, RECOVERY_S) if self._recovers else patience)
        if not self._heard:
            self._recovers = True
            raise BadReply(f"no answer within {patience * 1e3:g} ms")
        angles = self._answer()
        if self._recovers and (elapsed := monotonic() - self.asked_at) > patience:
            raise BadReply(f"answered after {elapsed * 1e3:.0f} ms instead of {patience * 1e3:g}")
        self._recovers = False
        return angles

    def _answer(self) -> Pair:
        try:
            angles = self._board.angles(self._heard)
        except BadReply:
            self._recovers = True
            raise
        self._owed, self._heard = 0, b""
        return angles

    def doubt(self) -> None:
        """The last answer could be read, but cannot be true."""
        self._owed, self._recovers = 1, True

    def close(self) -> None:
        self._port.close()

    def _settle(self) -> None:
        self._port.write(self._board.torques_off)
        self._owed += 1
        self._listen(LEAST_SIZE * self._owed, SETTLING_S)
        while more := self._port.read(monotonic() + GAP_S):  # answers to a guardian, which nobody counts
            self._heard += more
        bare = len(self._heard) <= self._owed and self._heard == self._board.bare_reply * len(self._heard)
        forgotten = bare and self._heard != b""
        self._owed = 0
        if forgotten:
            raise Forgotten("the board does not know of this device")
        self._mute = 0 if self._heard else self._mute + 1
        if self._mute >= MUTE_MOST:
            raise HardwareFault(f"{self.path}: does not answer")

    def _listen(self, size: int, patience: float) -> None:
        end = until = monotonic() + patience
        while len(self._heard) < size and (part := self._port.read(until)):
            self._heard += part
            until = min(end, monotonic() + GAP_S) if len(self._heard) % REPLY_SIZE else end
