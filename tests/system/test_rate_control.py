"""Sessions in virtual time whose operator deflects a rate-controlled device: bounded force, checked limits."""

from typing import Any

import pytest

from tests.system.systems import configuration, output, raw, steps, system
from weberlink.geometry.vector import ZERO, Vector, norm
from weberlink.master.devices.contract import DeviceReading, DeviceSpec
from weberlink.master.devices.rate_control import RateControl, RateOptions
from weberlink.master.devices.spacemouse.device import SpaceMouseDevice, SpaceMouseOptions
from weberlink.system.configuration import ConfigurationError
from weberlink.system.simulate import build_simulation

PUSH_N = 3.0
RELEASE = 2.0


class Deflected:
    """Pressed down with a full deflection, and released after `RELEASE` [s]; the spec of the real driver."""

    COMPUTED = True

    def __init__(self, options: Any, tick_period: float) -> None:
        self.spec: DeviceSpec = SpaceMouseDevice(SpaceMouseOptions(push_n=PUSH_N), tick_period).spec
        self._control = RateControl(RateOptions(push_n=PUSH_N))
        self._felt: Vector = ZERO
        self._began = self._at = 0.0

    def open(self, now: float) -> None:
        self._began = self._at = now

    def latest(self, now: float) -> DeviceReading:
        deflection = (0.0, 0.0, -1.0) if now - self._began < RELEASE else ZERO
        self._control.advance(deflection, self._felt, now - self._at)
        self._at = now
        return DeviceReading(now, self._control.position)

    def command(self, force: Vector, now: float) -> None:
        self._felt = force

    def close(self) -> None: ...


@pytest.mark.parametrize("overrides", [(), ("link.emulate={delay_ms: 10}",)], ids=["at once", "10 ms each way"])
def test_full_deflection_holds_its_push_and_release_ends_it(overrides: tuple[str, ...]) -> None:
    run = list(steps(system(*overrides, device=Deflected), 3.0))
    forces = [norm(raw(step.slave)) for step in run]
    held = forces[1500:2000]
    assert max(forces) <= PUSH_N * 1.2, "the deadband, of 10 %, and the delay"
    assert min(held) >= PUSH_N * 0.85
    depths = [output(step.slave)[2] for step in run[1500:2000]]
    assert max(depths) - min(depths) < 0.5e-3, "it stands still"
    assert forces[-1] < 0.1


def test_force_limit_below_the_push_is_refused() -> None:
    with pytest.raises(ConfigurationError, match=r"master\.limits\.force_n"):
        build_simulation(configuration("master.limits.force_n=2", device=Deflected))
