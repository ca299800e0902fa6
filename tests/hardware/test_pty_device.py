"""An emulated serial device comes and goes under one path."""

import os
import threading
from pathlib import Path
from time import monotonic

import pytest

from tests.hardware.scripted import descriptors
from tests.hardware.test_emulator import Echo
from weberlink.hardware.fault import HardwareFault
from weberlink.hardware.pty_device import PtyDevice
from weberlink.hardware.serial_port import SerialPort


def soon() -> float:
    return monotonic() + 10.0


def test_a_device_keeps_its_path_and_its_state_through_unplugging(tmp_path: Path) -> None:
    files, threads = descriptors(), threading.active_count()
    echo, path = Echo(), tmp_path / "tty"
    with PtyDevice(echo, path) as device:
        for _ in range(3):
            assert (device.plugged, device.serving) == (True, True)
            port = SerialPort(str(path))
            port.write(b"hello")
            assert port.read(soon()) == b"HELLO"
            device.unplug()
            assert (device.plugged, device.serving) == (False, False)
            assert not path.is_symlink()
            with pytest.raises(HardwareFault, match="unplugged"):
                port.read(soon())
            with pytest.raises(HardwareFault, match="there is no such port"):
                SerialPort(str(path))
            port.close()
            device.unplug()
            device.plug()
    assert echo.heard == [b"hello"] * 3
    assert not path.is_symlink()
    assert (descriptors(), threading.active_count()) == (files, threads)


def test_a_port_may_be_opened_again_and_again(tmp_path: Path) -> None:
    with PtyDevice(Echo(), tmp_path / "tty") as device:
        for _ in range(3):
            port = SerialPort(str(device.path))
            port.write(b"hello")
            assert port.read(soon()) == b"HELLO"
            port.close()


def test_every_byte_gets_through(tmp_path: Path) -> None:
    """No line discipline changes, doubles or swallows any, not even before the host has opened and set up the port."""

    class Mirror(Echo):
        def receive(self, data: bytes, now: float) -> None:
            self._waiting.append(data)

    with PtyDevice(Mirror(), tmp_path / "tty") as device:
        port = os.open(device.path, os.O_RDWR | os.O_NOCTTY)
        os.write(port, bytes(range(256)))
        came = b""
        while len(came) < 256:
            came += os.read(port, 1000)
        assert came == bytes(range(256))
        os.close(port)


def test_a_path_that_is_taken_is_not_touched(tmp_path: Path) -> None:
    files, threads = descriptors(), threading.active_count()
    (tmp_path / "tty").write_text("mine")
    device = PtyDevice(Echo(), tmp_path / "tty")
    with pytest.raises(FileExistsError), device:
        pass
    assert not device.plugged
    device.unplug()
    assert (tmp_path / "tty").read_text() == "mine"
    assert (descriptors(), threading.active_count()) == (files, threads)
    with pytest.raises(FileNotFoundError):
        PtyDevice(Echo(), tmp_path / "none" / "tty").plug()
    assert descriptors() == files


def test_it_ends_with_what_happens_in_the_with(tmp_path: Path) -> None:
    files = descriptors()
    with pytest.raises(KeyError), PtyDevice(Echo(), tmp_path / "tty"):
        raise KeyError
    assert not (tmp_path / "tty").is_symlink()
    assert descriptors() == files
