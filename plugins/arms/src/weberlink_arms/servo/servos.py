"""The servos of an arm: found, and asked with patience."""

from typing import ClassVar, Generic, TypeVar

from weberlink.hardware.fault import BadReply, HardwareFault
from weberlink_arms.servo.bus import Register, ServoBus

Bus = TypeVar("Bus", bound=ServoBus)


class Servos(Generic[Bus]):
    """All servos of an arm; a subclass says what they are, and sets them up."""

    TORQUE: ClassVar[Register]
    """Whether the torque is on."""
    KIND: ClassVar[str]

    def __init__(self, bus: Bus) -> None:
        self.bus = bus
        self._next = 0

    def advice(self) -> str:
        """What to check where none answers."""
        raise NotImplementedError

    def find(self) -> None:
        """Check that all are there; raises HardwareFault with what to check."""
        bus = self.bus
        missing = [id_ for id_ in bus.ids if not self._answers(id_)]
        if len(missing) == len(bus.ids):
            raise HardwareFault(f"{bus.path}: no {self.KIND} answers at {bus.baud} bit/s: check {self.advice()}")
        if missing:
            raise HardwareFault(
                f"{', '.join(map(bus.label, missing))}: no answer at {bus.baud} bit/s, but others answer: check the "
                "cable to it, its id and its baud rate"
            )

    def watch(self) -> None:
        """Check the torque of one servo, in turn, since its measurements do not show it.

        Raises:
            BadReply: as of the bus.
            HardwareFault: it was without power.
        """
        ids = self.bus.ids
        self.check_torque(ids[self._next])
        self._next = (self._next + 1) % len(ids)

    def check_torque(self, id_: int) -> None:
        if not self.bus.read(id_, self.TORQUE):
            raise HardwareFault(f"{self.bus.label(id_)}: its torque is off; was it without power?")

    def read(self, id_: int, register: Register) -> int:
        """A register, with patience."""
        return self.bus.insist(lambda: self.bus.read(id_, register))

    def write(self, id_: int, register: Register, value: int) -> None:
        self.bus.insist(lambda: self.bus.write(id_, register, value))

    def _answers(self, id_: int) -> bool:
        try:
            self.bus.insist(lambda: self.bus.ping(id_))
        except BadReply:
            return False
        return True
