"""Builds a driver from its name and options, and runs its test."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from weberlink.cli.device_test.dialog import DeviceTestError, Dialog, StoppedByUser
from weberlink.cli.device_test.master import try_master
from weberlink.cli.device_test.robot import try_robot
from weberlink.cli.devices import ARMS, SECTIONS, SIDES
from weberlink.config import MASTER, ConfigurationError, load
from weberlink.config.document import override
from weberlink.config.errors import require_package, validated
from weberlink.config.loading import make_absolute
from weberlink.installation import absence
from weberlink.master.devices.contract import DeviceFault
from weberlink.session.composition.link import build_driver
from weberlink.slave.robots.contract import RobotFault

RATE_HZ = 1000.0
"""Rate of the loop that the driver is built for, if there is no file."""


def run(name: str, dialog: Dialog, file: Path | None = None, overrides: Sequence[str] = ()) -> None:
    """Test a device or a robot.

    Args:
        name: driver to test.
        dialog: with the person.
        file: configuration that names it; None for its defaults.
        overrides: "key=value" each, for options of the driver; keys may have the full path.

    Raises:
        ConfigurationError: there is no such driver, or its options are wrong.
        DeviceTestError: the test failed, or the person stopped. The force is zero and the device closed.
    """
    if any(name in each for each in ARMS.values()):
        raise ConfigurationError(
            f"{name}: this test moves one handle or one tool, and knows no arms; start as docs/arms/ says"
        )
    side = next((side for side, each in SIDES.items() if name in each), None)
    if side is None:
        absent = {each: guest for table in (*SIDES.values(), *ARMS.values()) for each, guest in table.absent().items()}
        if name in absent:
            raise ConfigurationError(absence(f"driver {name!r}", absent[name]))
        known = ", ".join(name for each in SIDES.values() for name in sorted(each))
        raise ConfigurationError(f"{name}: there is no such driver; there are {known}")
    section = SECTIONS[side]
    overrides = [text.removeprefix(f"{section}.") for text in overrides]
    driver, options, tick_period = _alone(name, side, overrides) if file is None else _of(file, name, side, overrides)

    def build(*arguments: Any) -> Any:
        return build_driver(section, driver, *arguments, tick_period)

    try:
        if side == MASTER:
            try_master(driver, options, build, dialog)
        else:
            try_robot(driver, lambda: build(options, None), dialog)
    except (DeviceFault, RobotFault) as fault:
        raise DeviceTestError(str(fault)) from None
    except (StoppedByUser, KeyboardInterrupt):
        dialog.tell("")
        left = "; the force is off" if side == MASTER else ""
        raise DeviceTestError(f"{name}: stopped before the end{left}") from None


def _of(file: Path, name: str, side: str, overrides: Sequence[str]) -> tuple[Any, BaseModel, float]:
    """The driver of a configuration, its options and its tick period [s]."""
    section = SECTIONS[side]
    loaded = load(file, [f"{section}.{text}" for text in overrides], sides=[side])
    settings = loaded.system.master.device if side == MASTER else loaded.system.slave.robot
    part = loaded.device if side == MASTER else loaded.robot
    assert part is not None
    if settings.driver != name:
        raise ConfigurationError(f"{file}: {section}.driver: is {settings.driver}, not {name}")
    return part.driver, part.options, loaded.system.tick_period


def _alone(name: str, side: str, overrides: Sequence[str]) -> tuple[Any, BaseModel, float]:
    """A driver with its defaults and the overrides."""
    try:
        driver: Any = SIDES[side][name]
    except (ImportError, ValueError) as error:
        why = str(error) if isinstance(error, ValueError) else f"{name}: cannot be loaded: {error}"
        raise ConfigurationError(why) from None
    if hasattr(driver, "NEEDS"):
        package, extra = driver.NEEDS
        require_package(package, extra, name)
    content: dict[str, Any] = {}
    overridden = {override(content, text) for text in overrides}
    options = validated(driver.Options, content, name)
    return driver, make_absolute(options, Path.cwd(), overridden), 1.0 / RATE_HZ
