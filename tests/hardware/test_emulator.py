"""The loop between an emulated device and its host, and the pseudo terminal that carries it."""

import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from time import monotonic

import pytest

from tests.hardware.descriptors import descriptors
from tests.wait import PATIENCE
from weberlink.hardware.emulator import LONGEST_PAUSE_S as PAUSE_S
from weberlink.hardware.emulator import PtyDevice, WireFaults, serve
from weberlink.hardware.fault import HardwareFault
from weberlink.hardware.serial_port import SerialPort


class Echo:
    """Sends back what it hears, in upper case, a moment later; and says hello when told to."""

    def __init__(self) -> None:
        self.faults = WireFaults()
        self.heard: list[bytes] = []
        self.advances: list[float] = []
        self.timer: float | None = None
        self._waiting: list[bytes] = []

    def receive(self, data: bytes, now: float) -> None:
        self.heard.append(data)
        self._waiting.append(data.upper())

    def advance(self, now: float) -> None:
        self.advances.append(now)
        if self.timer is not None and now >= self.timer:
            self.timer = None
            self._waiting.append(b"HELLO")

    def replies(self, now: float) -> list[bytes]:
        due, self._waiting = self._waiting, []
        return due

    def next_timer(self) -> float | None:
        return self.timer


@contextmanager
def served(emulator: Echo) -> Iterator[socket.socket]:
    """The host's end."""
    host, device = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    device.setblocking(False)
    host.settimeout(PATIENCE)
    stopping = threading.Event()
    thread = threading.Thread(target=serve, args=(emulator, device.fileno(), stopping.is_set))
    thread.start()
    try:
        yield host
    finally:
        stopping.set()
        thread.join(PATIENCE)
        assert not thread.is_alive()
        host.close()
        device.close()


def asked(host: socket.socket, question: bytes) -> bytes:
    host.send(question)
    return host.recv(100)


def test_bytes_go_in_and_messages_come_out_garbled_and_late_where_asked() -> None:
    echo = Echo()
    with served(echo) as host:
        assert [asked(host, b"one"), asked(host, b"two")] == [b"ONE", b"TWO"]
        assert echo.heard == [b"one", b"two"]
        echo.faults.garble = 2
        torn = [asked(host, b"question") for _ in range(4)]
        assert [sum(a != b for a, b in zip(each, b"QUESTION", strict=True)) for each in torn] == [1, 1, 0, 0]
        assert echo.faults.garble == 0
        echo.faults.late_s = 0.5 * PAUSE_S
        began = monotonic()
        assert asked(host, b"one") == b"ONE"
        assert monotonic() - began >= 0.5 * PAUSE_S
    assert echo.advances == sorted(echo.advances), "time does not go back"


def test_unplugging_keeps_path_and_state(tmp_path: Path) -> None:
    files, threads = descriptors(), threading.active_count()
    echo, path = Echo(), tmp_path / "tty"
    with PtyDevice(echo, path) as device:
        for _ in range(3):
            assert (device.plugged, device.serving) == (True, True)
            port = SerialPort(str(path))
            port.write(b"hello")
            assert port.read(monotonic() + PATIENCE) == b"HELLO"
            device.unplug()
            assert (device.plugged, device.serving) == (False, False)
            assert not path.is_symlink()
            with pytest.raises(HardwareFault, match="unplugged"):
                port.read(monotonic() + PATIENCE)
            with pytest.raises(HardwareFault, match="there is no such port"):
                SerialPort(str(path))
            port.close()
            device.unplug()
            device.plug()
    assert echo.heard == [b"hello"] * 3
    assert not path.is_symlink()
    assert (descriptors(), threading.active_count()) == (files, threads)
