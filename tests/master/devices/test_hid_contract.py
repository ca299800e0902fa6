"""The HID driver keeps the contract through the real hidapi, in a process that sees an emulated device."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.master.devices.hid_bench import ADDRESS, HidBenches
from weberlink.hardware.umockdev import Testbed, missing

CONTRACT = Path(__file__).with_name("test_contract.py")


def test_polhem_hid_keeps_the_contract(tmp_path: Path) -> None:
    reason = missing()
    if reason is not None:
        pytest.skip(reason)
    address = tmp_path / "bench"
    with Testbed() as testbed, HidBenches(testbed, "polhem_hid", address):
        ended = subprocess.run(
            [sys.executable, "-m", "pytest", str(CONTRACT), "-k", "polhem_hid", "-p", "no:cacheprovider"],
            env=testbed.environment | {ADDRESS: str(address)},
            cwd=CONTRACT.parents[3],
            capture_output=True,
            text=True,
            timeout=120,
            check=False,
        )
    assert ended.returncode == 0, ended.stdout
    passed = re.search(r"(\d+) passed", ended.stdout)
    assert passed is not None, ended.stdout
    assert int(passed[1]) >= 10, ended.stdout
    assert "skipped" not in ended.stdout
