"""Drivers with a thread of their own in virtual time: a test steps their worker, which starts no thread."""

from collections.abc import Callable
from typing import Any

from weberlink.hardware.fault import HardwareFault
from weberlink.hardware.worker import Worker


class SteppedWorker(Worker[Any, Any]):
    """Runs the exchange when it is due."""

    _runs = False
    _due = 0.0

    @classmethod
    def of(cls, driver: Any, clock: Callable[[], float]) -> "SteppedWorker":
        """Take the thread off a driver that is not open; its time is that of a clock from now on."""
        worker = driver._worker
        worker.__class__, worker._clock = cls, clock
        assert isinstance(worker, cls)
        return worker

    @property
    def device(self) -> Any:
        """The exchange that a driver was made with."""
        return getattr(self._exchange, "_exchange", self._exchange)

    def start(self) -> None:
        self.stop()
        self._begin()
        self._due = self._clock()
        self._runs = True

    def step(self) -> None:
        """Exchange as often as it is due."""
        while self._runs and self._due <= self._clock():
            self._due = max(self._due + self._period, self._clock())
            try:
                self._once()
            except HardwareFault as fault:
                self.fault = str(fault)
                self.stop()

    def stop(self) -> None:
        if self._runs:
            self._runs = False
            self._exchange.close()
