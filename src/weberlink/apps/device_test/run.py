"""Builds a driver from its name and options, and runs its test."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ValidationError

from weberlink.apps.device_test.dialog import DeviceTestError, Dialog, StoppedByUser
from weberlink.apps.device_test.master import try_master
from weberlink.apps.device_test.robot import try_robot
from weberlink.apps.devices import ARMS, SECTIONS, SIDES
from weberlink.master.devices.contract import DeviceFault
from weberlink.slave.robots.contract import RobotFault
from weberlink.system.composition.link import construct
from weberlink.system.configuration import MASTER, ConfigurationError, load
from weberlink.system.configuration.document import override
from weberlink.system.configuration.errors import describe
from weberlink.system.configuration.extras import need
from weberlink.system.configuration.loading import make_absolute

RATE_HZ = 1000.0
"""Rate of the loop that the driver is built for, if there is no file."""


@dataclass(frozen=True)
class DeviceTestRequest:
    """Arguments of the command.

    Args:
        name: driver to test.
        file: configuration that names it; None for its defaults.
        overrides: "key=value" each, for options of the driver; keys may have the full path.
    """

    name: str
    file: Path | None = None
    overrides: Sequence[str] = ()


@dataclass(frozen=True)
class _DriverUnderTest:
    """A driver and the arguments to build it."""

    side: str
    driver: Any
    options: BaseModel
    tick_period: float


def run(request: DeviceTestRequest, dialog: Dialog) -> None:
    """Test a device or a robot.

    Raises:
        ConfigurationError: there is no such driver, or its options are wrong.
        DeviceTestError: the test failed, or the person stopped. The force is zero and the device closed.
    """
    part = _part(request)
    where = SECTIONS[part.side]

    def build(*arguments: Any) -> Any:
        return construct(where, part.driver, *arguments, part.tick_period)

    try:
        if part.side == MASTER:
            try_master(part.driver, part.options, build, dialog)
        else:
            try_robot(part.driver, lambda: build(part.options, None), dialog)
    except (DeviceFault, RobotFault) as fault:
        raise DeviceTestError(str(fault)) from None
    except (StoppedByUser, KeyboardInterrupt):
        dialog.tell("")
        left = "; the force is off" if part.side == MASTER else ""
        raise DeviceTestError(f"{request.name}: stopped before the end{left}") from None


def _part(request: DeviceTestRequest) -> _DriverUnderTest:
    side = next((name for name, each in SIDES.items() if request.name in each), None)
    if any(request.name in each for each in ARMS.values()):
        raise ConfigurationError(
            f"{request.name}: this test moves one handle or one tool, and knows no arms; start as docs/arms/ says"
        )
    if side is None:
        known = ", ".join(name for each in SIDES.values() for name in sorted(each))
        raise ConfigurationError(f"{request.name}: there is no such driver; there are {known}")
    section = SECTIONS[side]
    overrides = [text.removeprefix(f"{section}.") for text in request.overrides]
    if request.file is not None:
        loaded = load(request.file, [f"{section}.{text}" for text in overrides], sides=[side])
        settings = loaded.system.master.device if side == MASTER else loaded.system.slave.robot
        part = loaded.device if side == MASTER else loaded.robot
        assert part is not None
        if settings.driver != request.name:
            raise ConfigurationError(f"{request.file}: {section}.driver: is {settings.driver}, not {request.name}")
        return _DriverUnderTest(side, part.driver, part.options, loaded.system.tick_period)
    return _alone(request.name, side, overrides)


def _alone(name: str, side: str, overrides: Sequence[str]) -> _DriverUnderTest:
    """A driver with its defaults and the overrides."""
    try:
        driver: Any = SIDES[side][name]
    except (ImportError, ValueError) as error:
        why = str(error) if isinstance(error, ValueError) else f"{name}: cannot be loaded: {error}"
        raise ConfigurationError(why) from None
    need_of(driver, name)
    content: dict[str, Any] = {}
    overridden = {override(content, text) for text in overrides}
    try:
        options = driver.Options.model_validate(content)
    except ValidationError as error:
        raise ConfigurationError(describe(error, driver.Options, (name,))) from None
    return _DriverUnderTest(side, driver, make_absolute(options, Path.cwd(), overridden), 1.0 / RATE_HZ)


def need_of(driver: Any, name: str) -> None:
    """Raise ConfigurationError if the optional package of a driver is not installed."""
    if hasattr(driver, "NEEDS"):
        package, extra = driver.NEEDS
        need(package, extra, name)
