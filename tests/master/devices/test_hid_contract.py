"""Drivers of devices of the kernel keep the contract through the real hidapi and evdev, with emulated devices."""

import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest

from tests.master.devices.hid_bench import ADDRESS, HidBenches
from weberlink.hardware.umockdev import Testbed, missing

CONTRACT = Path(__file__).with_name("test_contract.py")
LEAST = {"polhem_hid": 10, "spacemouse": 5, "gamepad": 5}
"""Tests that must have passed."""


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> dict[str, dict[str, str]]:
    """What is wrong by test of a device, from one process that sees the testbed; nothing for those that passed."""
    reason = missing()
    if reason is not None:
        pytest.skip(reason)
    folder = tmp_path_factory.mktemp("hid")
    address, report = folder / "bench", folder / "report.xml"
    command = [sys.executable, "-m", "pytest", CONTRACT, "-k", " or ".join(LEAST), "-p", "no:cacheprovider"]
    with Testbed() as testbed, HidBenches(testbed, address):
        ended = subprocess.run(
            [*command, f"--junitxml={report}"],
            env=testbed.environment | {ADDRESS: str(address)},
            cwd=CONTRACT.parents[3],
            capture_output=True,
            text=True,
            timeout=240,
            check=False,
        )
    assert report.exists(), ended.stdout + ended.stderr
    cases = {case.attrib["name"]: case for case in ElementTree.parse(report).iter("testcase")}
    wrong = {test: "\n".join(f"{part.tag}: {part.text}" for part in case) for test, case in cases.items()}
    return {name: {test: what for test, what in wrong.items() if name in test} for name in LEAST}


@pytest.mark.parametrize("name", LEAST)
def test_device_of_the_kernel_keeps_the_contract(name: str, results: dict[str, dict[str, str]]) -> None:
    assert {test: what for test, what in results[name].items() if what} == {}
    assert len(results[name]) >= LEAST[name]
