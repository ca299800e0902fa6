"""The emulated bus of the servos: when an instruction has arrived, who answers it, and when the answer has left.

Half duplex without echo: one byte takes the time of ten bits, an instruction counts when its last byte has arrived, and
each answer begins a return delay after the previous packet. Bytes that a host sends while answers are leaving would
collide on a real wire; here they are counted and received after them. Instructions with a wrong checksum are ignored.
"""

from collections import deque
from collections.abc import Sequence
from math import inf

from weberlink_arms.dynamixel.packet import (
    ALERT,
    BROADCAST,
    OVERHEAD,
    PING,
    SYNC_READ,
    SYNC_WRITE,
    Packet,
    PacketReader,
    StatusPacket,
    encode_status,
)
from weberlink_arms.emulators.dynamixel.servo import Servo, word

QUEUE = 64
"""Most instructions, and most answers, that wait; more are lost."""


class ServoBus:
    """Servos on one wire.

    Args:
        servos: In any order.
        baud: Rate of the wire [bit/s].
    """

    def __init__(self, servos: Sequence[Servo], baud: int) -> None:
        self._servos = tuple(servos)
        self._byte_s = 10.0 / baud
        self._reader = PacketReader()
        self._quiet_from = 0.0
        self._requests: deque[tuple[float, Packet]] = deque(maxlen=QUEUE)
        self._replies: deque[tuple[float, bytes]] = deque(maxlen=QUEUE)
        self.dead: set[int] = set()
        """Ids that no longer hear or say anything."""
        self.packets = 0
        """Instructions carried out."""
        self.errors = 0
        """Refusals of instructions, counted for each servo."""
        self.collisions = 0
        """Times that a host sent while an answer was leaving."""

    @property
    def bad_checksums(self) -> int:
        return self._reader.bad_crc

    @property
    def next_request(self) -> float:
        """When the oldest waiting instruction has arrived [s]; infinity for never."""
        return self._requests[0][0] if self._requests else inf

    @property
    def next_reply(self) -> float:
        """When the oldest answer has left [s]; infinity for never."""
        return self._replies[0][0] if self._replies else inf

    def receive(self, data: bytes, now: float) -> None:
        """Bytes that a host sends from `now` on."""
        if not data:
            return
        if now < self._quiet_from and self._replies:
            self.collisions += 1
        begin = max(now, self._quiet_from)
        self._quiet_from = begin + len(data) * self._byte_s
        at = begin
        for packet in self._reader.feed(data):
            at = min(self._quiet_from, at + (OVERHEAD + len(packet.parameters)) * self._byte_s)
            self._requests.append((at, packet))

    def perform(self, now: float) -> None:
        """Carry out the oldest instruction, which is due `now`."""
        _, packet = self._requests.popleft()
        self.packets += 1
        for servo, status in self._answers(packet, now):
            frame = encode_status(status)
            self._quiet_from += servo.return_delay + len(frame) * self._byte_s
            self._replies.append((self._quiet_from, frame))

    def leaving(self, now: float) -> list[bytes]:
        """The answers that have left by `now`, oldest first; each of them once."""
        left = []
        while self._replies and self._replies[0][0] <= now:
            left.append(self._replies.popleft()[1])
        return left

    def restart(self) -> None:
        """Power cycle: packets under way are lost, and dead servos live again."""
        self.dead.clear()
        self._reader.clear()
        self._requests.clear()
        self._replies.clear()

    def _answers(self, packet: Packet, now: float) -> list[tuple[Servo, StatusPacket]]:
        """The answers of the servos, in the order on the wire."""
        hearing = [servo for servo in self._servos if servo.id not in self.dead and servo.hears(now)]
        if packet.id != BROADCAST:
            hearing = [servo for servo in hearing if servo.id == packet.id]
        for servo in hearing:
            servo.heard_at = now
        if packet.id != BROADCAST or packet.instruction == PING:
            answers = [(servo, self._counted(servo.answer(packet, now))) for servo in hearing]
            return [(servo, status) for servo, status in answers if status is not None]
        if packet.instruction == SYNC_READ:
            return self._sync_read(packet.parameters, hearing)
        if packet.instruction == SYNC_WRITE:
            self._sync_write(packet.parameters, hearing)
        else:
            for servo in hearing:
                self._counted(servo.answer(packet, now))
        return []

    def _sync_read(self, parameters: bytes, hearing: Sequence[Servo]) -> list[tuple[Servo, StatusPacket]]:
        """Each servo waits for the answer of the one before it in the list, so all behind a silent one are silent."""
        by_id = {servo.id: servo for servo in hearing}
        answers: list[tuple[Servo, StatusPacket]] = []
        for id_ in parameters[4:]:
            servo = by_id.get(id_)
            status = None
            if servo is not None:
                error, data = servo.read(word(parameters, 0), word(parameters, 2))
                status = self._counted(servo.status(SYNC_READ, error, data))
            if servo is None or status is None:
                break
            answers.append((servo, status))
        return answers

    def _sync_write(self, parameters: bytes, hearing: Sequence[Servo]) -> None:
        """There is no answer, not even for an error."""
        if len(parameters) < 4:
            return
        address, size = word(parameters, 0), word(parameters, 2)
        for servo in hearing:
            for at in range(4, len(parameters) - size, size + 1):
                if parameters[at] == servo.id and size:
                    self.errors += bool(servo.write(address, parameters[at + 1 : at + 1 + size]))

    def _counted(self, status: StatusPacket | None) -> StatusPacket | None:
        self.errors += status is not None and status.error & ~ALERT != 0
        return status
