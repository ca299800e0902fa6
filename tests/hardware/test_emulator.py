"""The loop between an emulated device and its host, and the pseudo terminal that carries it."""

import threading
from pathlib import Path
from time import monotonic

import pytest

from tests.hardware.helpers import descriptors
from tests.wait import PATIENCE
from weberlink.hardware.emulator import Emulator
from weberlink.hardware.fault import HardwareFault
from weberlink.hardware.serial_port import SerialPort
from weberlink.testing.serving import LONGEST_PAUSE_S as PAUSE_S, PtyDevice


class Echo(Emulator):
    def __init__(self) -> None:
        super().__init__()
        self.heard: list[bytes] = []
        self.advances: list[float] = []

    def receive(self, data: bytes, now: float) -> None:
        self.heard.append(data)
        self.leaving.append(data.upper())

    def advance(self, now: float) -> None:
        self.advances.append(now)


def asked(port: SerialPort, question: bytes) -> bytes:
    port.write(question)
    answer = b""
    while len(answer) < len(question):
        answer += port.read(monotonic() + PATIENCE)
    return answer


def test_replies_are_garbled_late_or_missing_where_asked(tmp_path: Path) -> None:
    echo = Echo()
    with PtyDevice(echo, tmp_path / "tty") as device:
        port = SerialPort(str(device.path))
        assert asked(port, b"one") == b"ONE"
        echo.faults.garble = 2
        torn = [asked(port, b"question") for _ in range(4)]
        assert [sum(a != b for a, b in zip(each, b"QUESTION", strict=True)) for each in torn] == [1, 1, 0, 0]
        assert echo.faults.garble == 0
        echo.faults.late_s = 0.5 * PAUSE_S
        began = monotonic()
        assert asked(port, b"two") == b"TWO"
        assert monotonic() - began >= 0.5 * PAUSE_S
        echo.faults.silent = True
        port.write(b"three")
        assert port.read(monotonic() + 2.0 * PAUSE_S) == b""
        port.close()
    assert echo.advances == sorted(echo.advances), "time does not go back"


def test_unplugging_keeps_path_and_state(tmp_path: Path) -> None:
    files, threads = descriptors(), threading.active_count()
    echo, path = Echo(), tmp_path / "tty"
    with PtyDevice(echo, path) as device:
        for _ in range(3):
            assert (device.plugged, device.serving) == (True, True)
            port = SerialPort(str(path))
            assert asked(port, b"hello") == b"HELLO"
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
    assert b"".join(echo.heard) == b"hello" * 3
    assert not path.is_symlink()
    assert (descriptors(), threading.active_count()) == (files, threads)
