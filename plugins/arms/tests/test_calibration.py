"""The calibration with weights: it finds the torque of an emulated servo, and says what cannot be."""

import pytest

from weberlink.hardware.fault import HardwareFault
from weberlink.testing.stepping import VirtualPort, VirtualTime
from weberlink_arms.emulators.feetech import FeetechEmulator, FeetechEmulatorOptions
from weberlink_arms.feetech.bus import FeetechBus, FeetechServos
from weberlink_arms.feetech.calibration import Scales, Weighing, fit

OWN_NM = 0.1
STALL_NM = 1.7
FRICTION_NM = 0.09


def scales(emulator: FeetechEmulator, axis: int) -> Scales:
    time = VirtualTime()
    bus = FeetechBus(VirtualPort(emulator, time), 1_000_000, range(1, 7), clock=time.clock, pause=time.pause)
    return Scales(FeetechServos(bus), axis, 0.5, time.clock, time.pause)


def test_weights_give_torque_of_load_and_friction() -> None:
    options = FeetechEmulatorOptions(stall_nm=(STALL_NM,) * 6, friction_nm=FRICTION_NM, supply_v=7.0)
    emulator = FeetechEmulator(options)
    arm, weighings = scales(emulator, 2), []
    for torque in (0.0, 0.3, 0.7):
        emulator.joints[2].push = -OWN_NM - torque
        weighings.append(arm.weigh(torque))
    found = fit(weighings)
    assert found.per_load == pytest.approx(STALL_NM / 1000.0 * 7.0 / 7.4, rel=0.05)
    assert found.per_amp == pytest.approx(STALL_NM / 2.7, rel=0.05)
    assert found.friction == pytest.approx(FRICTION_NM, rel=0.4)
    assert found.supply == pytest.approx(7.0)
    assert found.error < 0.05
    arm.release()
    assert not any(emulator.torques_on)


def test_too_heavy_a_weight_is_refused() -> None:
    emulator = FeetechEmulator()
    arm = scales(emulator, 0)
    emulator.joints[0].push = -1.45
    with pytest.raises(HardwareFault, match=r"shoulder_pan: a load of .* take a lighter weight"):
        arm.weigh(1.45)


@pytest.mark.parametrize(
    ("weighings", "says"),
    [
        ([Weighing(0.1 * i, 50.0 * i, 0.1 * i, 5.0, 7.4) for i in (0, 1, 1)], "at least three different weights"),
        ([Weighing(0.1 * i, 50.0, 0.1 * i, 5.0, 7.4) for i in range(3)], "the same with every weight"),
    ],
)
def test_weighings_that_tell_nothing_are_refused(weighings: list[Weighing], says: str) -> None:
    with pytest.raises(ValueError, match=says):
        fit(weighings)
