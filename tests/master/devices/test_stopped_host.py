"""The process that pushes with a device is stopped, stalled and killed in turn: the force ends.

Only processes can show it: what ends the force of a stopped one is the board, a guardian, or a servo process.
"""

import json
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from time import monotonic, sleep
from typing import Any

import pytest

from tests.master.devices import pushing_host
from tests.master.devices.benches import BENCHES, ON_A_WIRE
from tests.program import ROOT
from tests.wait import until
from weberlink.geometry.vector import ZERO
from weberlink.master.devices.contract import DeviceFault

LIMIT_S = 0.5
PATIENT: dict[str, dict[str, Any]] = {"haply_2diy": {"reply_ms": 100.0}, "inverse3": {"reply_ms": 100.0}}


@pytest.mark.realtime(alone=True)
@pytest.mark.parametrize("name", sorted({*ON_A_WIRE} - {"polhem_hid"}))
def test_force_ends_while_the_host_does_nothing(name: str, tmp_path: Path) -> None:
    with BENCHES[name](tmp_path, **PATIENT.get(name, {})) as bench:
        felt = bench.felt
        assert felt is not None
        command = [sys.executable, "-m", pushing_host.__name__, name, json.dumps(bench.options), "0.8"]
        with subprocess.Popen(command, cwd=ROOT, stdin=subprocess.PIPE, text=True) as host:

            def ends_after(deed: Callable[[], object]) -> None:
                until(lambda: felt()[1] > 0.4, "the push", pause=1e-3)
                deed()
                began = monotonic()
                until(lambda: felt() == ZERO, "the end of the force", pause=1e-3)
                assert monotonic() - began <= LIMIT_S

            def stall() -> None:
                assert host.stdin is not None
                host.stdin.write("0.3\n")
                host.stdin.flush()

            def opens() -> bool:
                try:
                    bench.device.open(monotonic())
                except DeviceFault:
                    return False
                return True

            try:
                for stopped_s in (0.05, 0.3):
                    ends_after(lambda: host.send_signal(signal.SIGSTOP))
                    sleep(stopped_s)
                    assert felt() == ZERO
                    host.send_signal(signal.SIGCONT)
                ends_after(stall)
                ends_after(host.kill)
                host.wait()
                until(opens, "the device to be free")
            finally:
                host.kill()
