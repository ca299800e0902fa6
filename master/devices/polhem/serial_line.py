"""The bracket protocol on a serial port: currents go out, states come in."""

from itertools import repeat
from time import monotonic

from weberlink.hardware.serial_port import SerialPort
from weberlink.master.devices.polhem.bracket import Currents, Status, StatusReader, encode_currents


class SerialLine:
    """An open port; see `lock_step.Line`.

    Raises:
        HardwareFault: it cannot be opened.
    """

    def __init__(self, path: str) -> None:
        self._port = SerialPort(path)
        self._reader = StatusReader()

    def send(self, message: Currents) -> None:
        self._port.write(encode_currents(message))

    def hear(self, until: float) -> list[Status | None]:
        reader = self._reader
        while data := self._port.read(until):
            malformed = reader.malformed
            good = reader.feed(data)
            # Where in a burst the bad ones were does not matter: then there are too many anyway.
            answers: list[Status | None] = [*repeat(None, reader.malformed - malformed), *good]
            if answers:
                return answers
            if monotonic() > until:
                break
        return []

    def close(self) -> None:
        self._port.close()
