"""What is said of HID devices that cannot be opened; the rest is tested through umockdev."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.hardware.scripted import descriptors
from tests.hardware.test_serial_port import NOBODY, TRY
from weberlink.hardware.fault import HardwareFault
from weberlink.hardware.hid_port import HidPort

ROOT = Path(__file__).parents[2]


def test_a_device_that_is_not_there_or_none(tmp_path: Path) -> None:
    files = descriptors()
    with pytest.raises(HardwareFault, match=r"hidraw99: there is no such device; `weberlink devices` lists"):
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
    ready = f"from hardware.hid_port import HidPort as Port, hidapi\nhidapi()\n{program}"
    command = [sys.executable, "-c", ready, str(locked)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=60, check=False)
    assert f"no permission to open {locked}; install the shipped rules" in done.stdout
