"""What is said of HID devices that cannot be opened; the rest is tested through umockdev."""

import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from time import monotonic

import pytest

from tests.hardware.scripted import descriptors
from tests.hardware.test_serial_port import NOBODY, TRY
from weberlink.hardware.fault import HardwareFault
from weberlink.hardware.hid_port import HidPort

ROOT = Path(__file__).parents[2]


def test_a_device_that_is_not_there_or_none(tmp_path: Path) -> None:
    files = descriptors()
    with pytest.raises(HardwareFault, match=r"hidraw99: there is no such device; `weberlink device list` lists"):
        HidPort("/dev/hidraw99")
    with pytest.raises(HardwareFault, match="Is a directory"):
        HidPort(str(tmp_path))
    (tmp_path / "file").touch()
    with pytest.raises(HardwareFault, match="file: open failed"):
        HidPort(str(tmp_path / "file"))
    assert descriptors() == files


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can become somebody who may not")
def test_a_device_that_this_user_may_not_open(tmp_path: Path) -> None:
    """A file that only root may read and write, in place of a node with the kernel's own permissions."""
    locked = tmp_path / "hidraw0"
    locked.touch(0o600)
    program = f"import os; os.setgid({NOBODY}); os.setuid({NOBODY})\nimport sys\n{TRY}"
    ready = f"from weberlink.hardware.hid_port import HidPort as Port, hidapi\nhidapi()\n{program}"
    command = [sys.executable, "-c", ready, str(locked)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=60, check=False)
    assert f"no permission to open {locked}; install the shipped rules" in done.stdout


class ScriptedHidapi:
    """Like hidapi, not blocking: `waiting` can be read at once, and `later` comes within a read that waits."""

    def __init__(self, waiting: Sequence[bytes] = (), later: Sequence[bytes] = ()) -> None:
        self._waiting = list(waiting)
        self._later = list(later)
        self.timeouts: list[int] = []

    def read(self, size: int, timeout_ms: int = 0, /) -> list[int]:
        if timeout_ms:
            self.timeouts.append(timeout_ms)
            self._waiting += self._later
            self._later = []
        return list(self._waiting.pop(0))[:size] if self._waiting else []


def port_on(device: ScriptedHidapi) -> HidPort:
    port = HidPort.__new__(HidPort)
    port.path, port._device = "/dev/hidraw9", device
    return port


A, B, C = b"\x01" * 14, b"\x02" * 14, b"\x03" * 14


@pytest.mark.parametrize(
    ("waiting", "later", "expected"),
    [([], [], []), ([A, B, C], [], [A, B, C]), ([], [A], [A]), ([], [A, B, C], [A, B, C])],
)
def test_no_report_is_dropped(waiting: list[bytes], later: list[bytes], expected: list[bytes]) -> None:
    assert port_on(ScriptedHidapi(waiting, later)).read_all(monotonic() + 0.01) == expected


def test_elapsed_time_limit_never_waits_for_ever() -> None:
    """hidapi would wait for ever with a timeout of 0 ms."""
    device = ScriptedHidapi()
    assert port_on(device).read_all(monotonic() - 1.0) == []
    assert device.timeouts == [1]
    assert port_on(device).read_all(0.0) == []
    assert device.timeouts == [1]
