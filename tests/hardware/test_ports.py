"""Serial and HID ports: what comes, what goes, and what is said when neither does; HID over umockdev elsewhere."""

import os
import subprocess
import sys
import tty
from collections.abc import Iterator, Sequence
from contextlib import suppress
from math import inf
from pathlib import Path
from threading import Thread
from time import monotonic
from typing import Any

import pytest

from tests.hardware.helpers import descriptors
from tests.program import ROOT
from tests.strangers import NOBODY, needs_root
from tests.wait import PATIENCE, until
from weberlink.hardware.fault import HardwareFault
from weberlink.hardware.guardian import Guardian
from weberlink.hardware.hid_port import HidPort
from weberlink.hardware.serial_port import SerialPort


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
    return monotonic() + PATIENCE


def test_bytes_go_both_ways_unchanged(wire: Wire, port: SerialPort) -> None:
    every_byte = bytes(range(256))
    os.write(wire.near, every_byte)
    came = b""
    while len(came) < 256:
        came += port.read(soon())
    assert came == every_byte
    assert (port.read(monotonic()), port.drain()) == (b"", b"")
    port.write(every_byte)
    assert os.read(wire.near, 1000) == every_byte
    port.write(b"zero force")
    port.close()
    assert os.read(wire.near, 100) == b"zero force", "what was written last still arrives"


def test_a_closed_port_leaves_the_file_alone_that_has_its_number_now(wire: Wire) -> None:
    port = SerialPort(wire.path)
    port.close()
    pipes = [os.pipe() for _ in range(8)]  # among them the number of the port
    try:
        for _, end in pipes:
            os.write(end, b"of others")
        for use in (lambda: port.read(monotonic()), port.drain, lambda: port.write(b"force")):
            with pytest.raises(HardwareFault):
                use()
        assert [os.read(end, 100) for end, _ in pipes] == [b"of others"] * 8
    finally:
        for end in (end for pipe in pipes for end in pipe):
            os.close(end)


@pytest.mark.parametrize(
    ("kind", "name", "says"),
    [
        (SerialPort, "none", "there is no such port"),
        (SerialPort, "link", "there is no such port"),
        (SerialPort, "file", "this is no serial port"),
        (SerialPort, "", "Is a directory"),
        (HidPort, "none", "there is no such device"),
        (HidPort, "", "Is a directory"),
        (HidPort, "file", r"\S"),
    ],
)
def test_what_is_no_port_is_said_and_leaves_no_descriptor(kind: Any, name: str, says: str, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("hello")
    (tmp_path / "link").symlink_to(tmp_path / "gone")
    if kind is HidPort:
        pytest.importorskip("hid")
    files = descriptors()
    with pytest.raises(HardwareFault, match=says) as caught:
        kind(str(tmp_path / name))
    assert str(caught.value).startswith(str(tmp_path))
    assert descriptors() == files


def test_port_belongs_to_one_process_until_closed(wire: Wire) -> None:
    program = (
        "import sys; from weberlink.hardware.serial_port import SerialPort\n"
        "port = SerialPort(sys.argv[1]); print('open', flush=True); sys.stdin.read()"
    )
    command = [sys.executable, "-c", program, wire.path]
    files = descriptors()
    with subprocess.Popen(command, cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as other:
        assert other.stdout is not None
        assert other.stdout.readline() == "open\n"
        with pytest.raises(HardwareFault, match="in use by another process"):
            SerialPort(wire.path)
        other.communicate()
    port = SerialPort(wire.path)
    with pytest.raises(HardwareFault, match="in use"):
        SerialPort(wire.path)
    port.close()
    with pytest.raises(HardwareFault):
        SerialPort(wire.path, -1)
    assert descriptors() == files
    SerialPort(wire.path).close()


def test_a_guardian_that_does_not_start_leaves_the_port_free(wire: Wire) -> None:
    class Refusing(Guardian):
        def watch(self, descriptor: int) -> None:
            raise HardwareFault("its guardian process does not start")

    files = descriptors()
    with pytest.raises(HardwareFault, match="does not start"):
        SerialPort(wire.path, guardian=Refusing(b"zero"))
    assert descriptors() == files
    SerialPort(wire.path).close()


@needs_root
@pytest.mark.parametrize("kind", ["serial_port.SerialPort", "hid_port.HidPort"])
def test_a_port_that_this_user_may_not_open(kind: str, wire: Wire) -> None:
    locked = Path(wire.path)
    locked.chmod(0o600)
    module, _, name = kind.partition(".")
    loads = "from weberlink.hardware.hid_port import hidapi; hidapi()\n" if name == "HidPort" else ""
    program = (
        f"import os, sys; from weberlink.hardware.{module} import {name}\n{loads}"
        f"os.setgid({NOBODY}); os.setuid({NOBODY})\n"
        f"try:\n {name}(sys.argv[1])\nexcept RuntimeError as fault:\n print(fault)"
    )
    command = [sys.executable, "-c", program, str(locked)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=PATIENCE, check=False)
    assert f"no permission to open {locked}; install the shipped rules" in done.stdout


def test_an_unplugged_port_says_so_in_every_direction(wire: Wire, port: SerialPort) -> None:
    wire.unplug()
    for use in (lambda: port.read(soon()), port.drain, lambda: port.write(b"x")):
        with pytest.raises(HardwareFault, match=f"{wire.path}: unplugged"):
            use()
    port.close()
    with pytest.raises(HardwareFault, match=f"{wire.path}: unplugged"):
        port.read(soon())


def test_write_to_blocked_device_is_a_fault(wire: Wire, port: SerialPort) -> None:
    with pytest.raises(HardwareFault, match="takes no more data"):
        port.write(b"x" * 1_000_000)
    os.set_blocking(wire.near, False)
    taken = len(os.read(wire.near, 10_000_000))
    assert 0 < taken < 1_000_000
    port.write(b"better")
    until(lambda: b"better" in os.read(wire.near, 10_000_000), "what is written later")


# --- HID: no device is here, so in place of hidapi stands one with its interface


class ScriptedHidapi:
    """Like hidapi, not blocking: `waiting` can be read at once, and `later` comes within a read that waits."""

    def __init__(self, waiting: Sequence[bytes] = (), later: Sequence[bytes] = ()) -> None:
        self._waiting, self._later = list(waiting), list(later)
        self.timeouts: list[int] = []
        self.done: list[Any] = []
        self.takes: int | None = None

    def write(self, message: bytes, /) -> int:
        self.done.append(message)
        return len(message) if self.takes is None else self.takes

    def close(self) -> None:
        self.done.append("closed")

    def read(self, size: int, timeout_ms: int = 0, /) -> list[int]:
        if timeout_ms:
            self.timeouts.append(timeout_ms)
            self._waiting += self._later
            self._later = []
        return list(self._waiting.pop(0))[:size] if self._waiting else []


def port_on(device: ScriptedHidapi) -> HidPort:
    port = HidPort.__new__(HidPort)
    port.path, port._device, port._guardian = "/dev/hidraw9", device, None
    return port


A, B, C = b"\x01" * 14, b"\x02" * 14, b"\x03" * 14


@pytest.mark.parametrize(
    ("waiting", "later", "over_s", "timeouts"),
    [([], [], 1.0, [1]), ([], [], inf, []), ([A, B, C], [], 1.0, []), ([], [A], 1.0, [1]), ([], [A, B, C], 1.0, [1])],
)
def test_no_report_is_dropped_and_none_waited_for_for_ever(
    waiting: list[bytes], later: list[bytes], over_s: float, timeouts: list[int]
) -> None:
    """hidapi would wait for ever with a timeout of 0 ms."""
    device = ScriptedHidapi(waiting, later)
    assert port_on(device).read_all(max(0.0, monotonic() - over_s)) == waiting + later
    assert device.timeouts == timeouts


class Noting(Guardian):
    """A guardian without a process: takes down what the port tells it."""

    def __init__(self, done: list[Any], zero: bytes = b"\0zero") -> None:
        super().__init__(zero)
        self._done = done

    def watch(self, descriptor: int) -> None:
        os.fstat(descriptor)
        self._done.append("watches")

    def before(self, data: bytes) -> None:
        self._done.append(("before", data))

    def after(self, data: bytes) -> None:
        self._done.append(("after", data))

    def stop(self) -> None:
        self._done.append("stopped")


def test_guardian_of_reports_is_told_before_and_after_each(tmp_path: Path) -> None:
    device = ScriptedHidapi()
    port = port_on(device)
    with pytest.raises(HardwareFault, match="no guardian can write to it"):
        port.guard(Noting(device.done))
    port.path = str(tmp_path / "node")
    Path(port.path).touch()
    files = descriptors()
    port.guard(Noting(device.done))
    assert descriptors() == files
    port.write(b"force", 3)
    port.close()
    message = b"\3force"
    assert device.done == ["watches", ("before", message), message, ("after", message), "stopped", "closed"]
    device.takes = 0
    port.write(b"zero")
    device.takes = -1
    device.done.clear()
    with pytest.raises(HardwareFault, match="unplugged"):
        port.write(b"force")
    assert device.done == [("before", b"\0force"), b"\0force"], "what was not written carries no force"


def test_long_messages_go_in_parts_where_no_guardian_may_write_between(wire: Wire) -> None:
    heard, most = bytearray(), 300_000

    def listen() -> None:
        with suppress(PermissionError):  # on a busy machine it would not be there in time
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
        while len(heard) < most:
            heard.extend(os.read(wire.near, 1000))

    listener = Thread(target=listen)
    listener.start()
    port = SerialPort(wire.path)
    port.write(b"x" * most)
    listener.join()
    port.close()
    guarded = SerialPort(wire.path, guardian=Noting([]))
    began = monotonic()
    with pytest.raises(HardwareFault, match="takes no more data"):
        guarded.write(b"x" * most)
    assert monotonic() - began < PATIENCE
    os.set_blocking(wire.near, False)
    assert 0 < len(os.read(wire.near, most)) < most
    guarded.close()
