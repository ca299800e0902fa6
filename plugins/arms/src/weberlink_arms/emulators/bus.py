"""The emulated bus of servos: when a request has arrived, who answers it, and when the answer has left.

Half duplex without echo: one byte takes the time of ten bits, a request counts when its last byte has arrived, and each
answer begins a return delay after the previous packet. What a host sends while answers are leaving is received after
them. Requests with a wrong checksum are ignored. In a sync read each servo waits for the answer of the one before it,
so all behind a silent one are silent.
"""

from collections import deque
from collections.abc import Sequence
from math import inf
from typing import Protocol

from weberlink_arms.servo.packet import BROADCAST, PING, SYNC_READ, SYNC_WRITE, Framing, Packet, Status

QUEUE = 64  # most requests, and most answers, that wait; more are lost


class EmulatedServo(Protocol):
    """A servo on the bus."""

    heard_at: float  # when the last request for it ended [s]

    @property
    def id(self) -> int: ...

    @property
    def return_delay(self) -> float: ...

    @property
    def torque_on(self) -> bool: ...

    def hears(self, now: float) -> bool: ...

    def answer(self, packet: Packet, now: float) -> Status | None:
        """Carry out a request for this servo, a sync read with its own address and size; None for no answer."""
        ...

    def write(self, address: int, data: bytes) -> int:
        """Write all of it or nothing; returns the error number."""
        ...


class EmulatedBus:
    """Servos on one wire, in any order; `baud` is its rate [bit/s]."""

    def __init__(self, framing: Framing, servos: Sequence[EmulatedServo], baud: int) -> None:
        self._framing, self._servos, self._byte_s = framing, tuple(servos), 10.0 / baud
        self._reader = framing.requests()
        self._quiet_from = 0.0
        self._requests: deque[tuple[float, Packet]] = deque(maxlen=QUEUE)
        self._replies: deque[tuple[float, bytes]] = deque(maxlen=QUEUE)
        self.dead: set[int] = set()  # ids that no longer hear or say anything

    @property
    def next_request(self) -> float:
        """When the oldest waiting request has arrived [s]; infinity for never."""
        return self._requests[0][0] if self._requests else inf

    @property
    def next_reply(self) -> float:
        """When the oldest answer has left [s]; infinity for never."""
        return self._replies[0][0] if self._replies else inf

    def receive(self, data: bytes, now: float) -> None:
        """Bytes that a host sends from `now` on."""
        at = max(now, self._quiet_from)
        self._quiet_from = at + len(data) * self._byte_s
        for packet in self._reader.feed(data):
            at = min(self._quiet_from, at + len(self._framing.encode(packet)) * self._byte_s)
            self._requests.append((at, packet))

    def perform(self, now: float) -> None:
        """Carry out the oldest request, which is due `now`."""
        _, packet = self._requests.popleft()
        hearing = [servo for servo in self._servos if servo.id not in self.dead and servo.hears(now)]
        if packet.id != BROADCAST:
            hearing = [servo for servo in hearing if servo.id == packet.id]
        for servo in hearing:
            servo.heard_at = now
        if packet.id == BROADCAST and packet.instruction == SYNC_READ:
            self._sync_read(packet, {servo.id: servo for servo in hearing}, now)
        elif packet.id == BROADCAST and packet.instruction == SYNC_WRITE:
            self._sync_write(packet.parameters, hearing)
        else:
            for servo in hearing:
                status = servo.answer(packet, now)
                if packet.id != BROADCAST or packet.instruction == PING:
                    self._say(servo, status)

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

    def _sync_read(self, packet: Packet, hearing: dict[int, EmulatedServo], now: float) -> None:
        begin = 2 * self._framing.WIDTH
        for id_ in packet.parameters[begin:]:
            servo = hearing.get(id_)
            own = packet._replace(id=id_, parameters=packet.parameters[:begin])
            if servo is None or not self._say(servo, servo.answer(own, now)):
                return

    def _sync_write(self, parameters: bytes, hearing: Sequence[EmulatedServo]) -> None:
        """There is no answer, not even for an error."""
        framing, begin = self._framing, 2 * self._framing.WIDTH
        address, size = framing.number(parameters, 0), framing.number(parameters, 1)
        for servo in hearing:
            for at in range(begin, len(parameters) - size, size + 1):
                if parameters[at] == servo.id and size:
                    servo.write(address, parameters[at + 1 : at + 1 + size])

    def _say(self, servo: EmulatedServo, status: Status | None) -> bool:
        if status is None:
            return False
        data = self._framing.encode(status)
        self._quiet_from += servo.return_delay + len(data) * self._byte_s
        self._replies.append((self._quiet_from, data))
        return True
