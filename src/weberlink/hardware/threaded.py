"""What drivers have in common whose blocking exchange runs in a thread."""

from typing import ClassVar, Generic

from weberlink.hardware.fault import HardwareFault
from weberlink.hardware.worker import Command, Exchange, Sample, Worker


class ThreadedDriver(Generic[Command, Sample]):
    """A driver whose exchange a `Worker` runs; times are of `time.monotonic` [s]. A subclass makes readings of samples.

    An exchange with a method `start_afresh` keeps its state over reconnections, but not over sessions: it is called
    before the first `open` of each session."""

    FAULT: ClassVar[type[Exception]]  # what the contract of its family raises

    def __init__(self, name: str, exchange: Exchange[Command, Sample], worker: Worker[Command, Sample]) -> None:
        self._name = name
        self.guarded = getattr(exchange, "guardian", None) is not None  # by a process, when this one stops
        self._start_afresh = getattr(exchange, "start_afresh", None)
        self._worker = worker
        self._is_open = False

    @property
    def trouble(self) -> str | None:
        return self._worker.trouble

    def open(self, now: float) -> None:  # noqa: ARG002
        self.close()
        if self._start_afresh is not None:
            self._start_afresh()
        try:
            self._worker.start()
        except HardwareFault as fault:
            raise self._fault(str(fault)) from None
        self._is_open = True

    def close(self) -> None:
        self._is_open = False
        self._worker.stop()

    def _check(self) -> None:
        """Raise the fault of a driver that is not open, or that cannot go on."""
        if not self._is_open:
            raise self._fault("not open")
        self._worker.check(self._fault)

    def _fault(self, why: str) -> Exception:
        """The fault with the driver's name in front, once."""
        name = f"{self._name}: "
        return self.FAULT(name + why.removeprefix(name))
