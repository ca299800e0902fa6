"""Drivers of devices of the kernel keep the contract through the real hidapi and evdev, with emulated devices."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.master.devices.hid_bench import ADDRESS, NAMED, HidBenches
from weberlink.hardware.umockdev import Testbed, missing

CONTRACT = Path(__file__).with_name("test_contract.py")
LEAST = {"polhem_hid": 10, "spacemouse": 5, "gamepad": 5}
"""Tests that must have passed."""


@pytest.mark.parametrize("name", LEAST)
def test_device_of_the_kernel_keeps_the_contract(name: str, tmp_path: Path) -> None:
    reason = missing()
    if reason is not None:
        pytest.skip(reason)
    address = tmp_path / "bench"
    with Testbed() as testbed, HidBenches(testbed, name, address):
        ended = subprocess.run(
            [sys.executable, "-m", "pytest", str(CONTRACT), "-k", name, "-p", "no:cacheprovider"],
            env=testbed.environment | {ADDRESS: str(address), NAMED: name},
            cwd=CONTRACT.parents[3],
            capture_output=True,
            text=True,
            timeout=120,
            check=False,
        )
    assert ended.returncode == 0, ended.stdout
    passed = re.search(r"(\d+) passed", ended.stdout)
    assert passed is not None, ended.stdout
    assert int(passed[1]) >= LEAST[name], ended.stdout
    assert "skipped" not in ended.stdout
