"""The process that pushes with a device is stopped, stalled and killed in turn: the force ends, and ramps up again.

Only processes can show it: what ends the force of a stopped one is the board, a guardian, or a servo process.
"""

from pathlib import Path
from time import sleep

import pytest

from tests.master.devices.benches import FAULTS, ON_A_WIRE
from tests.master.devices.pushing import PUSHING
from tests.wait import until

STALL_LIMIT_S = 0.5
"""In which the thread of the device ends the force of a loop that stands still."""
RISE = 1.05
"""Of what the ramp permits, with the rounding of currents."""


def test_every_device_with_a_wire_is_pushed_with() -> None:
    assert set(PUSHING) == {*ON_A_WIRE} - {"polhem_hid"}
    guarded = {name for name, fault in FAULTS if fault == "guardian"}
    assert guarded == {"haply_2diy", "inverse3"}


@pytest.mark.realtime(alone=True)
@pytest.mark.parametrize("name", PUSHING)
def test_force_ends_while_the_host_does_nothing_and_ramps_again(name: str, tmp_path: Path) -> None:
    with PUSHING[name](tmp_path) as device, device.host() as host:
        for stopped_s in (0.05, 0.3):
            assert host.zero_after(host.stop) <= device.limit_s
            sleep(stopped_s)
            seen = len(device.log())
            assert host.force == 0.0
            host.go_on()
            assert host.steepest_rise(seen) <= RISE
        assert host.zero_after(host.stall) <= STALL_LIMIT_S
        assert host.zero_after(host.process.kill) <= device.limit_s
        host.process.wait()
        until(device.opens, "the device to be free")
