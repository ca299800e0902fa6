"""A serial port over a pseudo terminal: what comes, what goes, and what is said when neither does."""

import os
import subprocess
import sys
import tty
from collections.abc import Iterator
from pathlib import Path
from time import monotonic

import pytest

from tests.hardware.scripted import descriptors, wait_for
from weberlink.hardware.fault import HardwareFault
from weberlink.hardware.serial_port import SerialPort

ROOT = Path(__file__).parents[2]
NOBODY = 65534
TRY = "try:\n Port(sys.argv[1])\nexcept RuntimeError as fault:\n print(fault)"


class Wire:
    """A pseudo terminal; `near` is the device's end."""

    def __init__(self) -> None:
        self.near, self._far = os.openpty()
        tty.setraw(self._far)
        self.path = os.ttyname(self._far)

    def unplug(self) -> None:
        if self.near >= 0:
            os.close(self.near)
            os.close(self._far)
            self.near = -1


@pytest.fixture
def wire() -> Iterator[Wire]:
    files = descriptors()
    there = Wire()
    yield there
    there.unplug()
    assert descriptors() == files, "and the ports of the test are closed too"


@pytest.fixture
def port(wire: Wire) -> Iterator[SerialPort]:
    opened = SerialPort(wire.path)
    yield opened
    opened.close()


def soon() -> float:
    return monotonic() + 10.0


def test_bytes_go_both_ways_unchanged(wire: Wire, port: SerialPort) -> None:
    every_byte = bytes(range(256))
    os.write(wire.near, every_byte)
    came = b""
    while len(came) < 256:
        came += port.read(soon())
    assert came == every_byte
    port.write(every_byte)
    assert os.read(wire.near, 1000) == every_byte


def test_what_is_no_port_is_said(tmp_path: Path) -> None:
    with pytest.raises(
        HardwareFault, match=r"tty9: there is no such port; `weberlink device list` lists what there is"
    ):
        SerialPort(str(tmp_path / "tty9"))
    (tmp_path / "file").write_text("hello")
    with pytest.raises(HardwareFault, match="file: this is no serial port"):
        SerialPort(str(tmp_path / "file"))
    with pytest.raises(HardwareFault, match="Is a directory"):
        SerialPort(str(tmp_path))
    with pytest.raises(HardwareFault):
        SerialPort("")
    (tmp_path / "link").symlink_to(tmp_path / "gone")
    with pytest.raises(HardwareFault, match="link: there is no such port"):
        SerialPort(str(tmp_path / "link"))


def test_port_belongs_to_one_process_until_closed(wire: Wire) -> None:
    program = (
        "import sys; from weberlink.hardware.serial_port import SerialPort\n"
        "port = SerialPort(sys.argv[1]); print('open', flush=True); sys.stdin.read()"
    )
    command = [sys.executable, "-c", program, wire.path]
    with subprocess.Popen(command, cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as other:
        assert other.stdout is not None
        assert other.stdin is not None
        assert other.stdout.readline() == "open\n"
        with pytest.raises(HardwareFault, match=r"in use by another process; is a second copy running\?"):
            SerialPort(wire.path)
        other.stdin.close()
        assert other.wait(60) == 0
    port = SerialPort(wire.path)
    with pytest.raises(HardwareFault, match="in use"):
        SerialPort(wire.path)
    port.close()
    SerialPort(wire.path).close()


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can become somebody who may not")
def test_a_port_that_this_user_may_not_open(wire: Wire) -> None:
    os.chmod(wire.path, 0o600)  # noqa: PTH101 - a device
    program = f"import os; os.setgid({NOBODY}); os.setuid({NOBODY})\nimport sys\n{TRY}"
    command = [
        sys.executable,
        "-c",
        f"from weberlink.hardware.serial_port import SerialPort as Port\n{program}",
        wire.path,
    ]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=60, check=False)
    assert f"no permission to open {wire.path}; install the shipped rules with: weberlink device rules" in done.stdout


def test_an_unplugged_port_says_so_in_every_direction(wire: Wire, port: SerialPort) -> None:
    wire.unplug()
    for use in (lambda: port.read(soon()), port.drain, lambda: port.write(b"x")):
        with pytest.raises(HardwareFault, match=f"{wire.path}: unplugged"):
            use()


def test_write_to_blocked_device_is_a_fault(wire: Wire, port: SerialPort) -> None:
    with pytest.raises(HardwareFault, match="takes no more data"):
        port.write(b"x" * 1_000_000)
    os.set_blocking(wire.near, False)
    taken = len(os.read(wire.near, 10_000_000))
    assert 0 < taken < 1_000_000
    port.write(b"better")
    wait_for(lambda: b"better" in os.read(wire.near, 10_000_000))


def test_what_was_written_last_still_arrives(wire: Wire, port: SerialPort) -> None:
    port.write(b"zero force")
    port.close()
    assert os.read(wire.near, 100) == b"zero force"


def test_failed_open_leaves_no_descriptor(wire: Wire, tmp_path: Path) -> None:
    taken = SerialPort(wire.path)
    files = descriptors()
    (tmp_path / "file").touch()
    for path in (wire.path, str(tmp_path / "file"), str(tmp_path / "none")):
        with pytest.raises(HardwareFault):
            SerialPort(path)
    with pytest.raises(HardwareFault):
        SerialPort(wire.path, -1)
    assert descriptors() == files
    taken.close()
