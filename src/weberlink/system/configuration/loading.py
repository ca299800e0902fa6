"""From a file to a validated configuration, with the options of the drivers that one side needs."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ValidationError

from weberlink.master import devices
from weberlink.slave import robots
from weberlink.system.configuration.document import override, parse
from weberlink.system.configuration.errors import ConfigurationError, describe
from weberlink.system.configuration.model import DriverSettings, System
from weberlink.system.configuration.paths import settle
from weberlink.system.extras import need

MASTER, SLAVE = "master", "slave"
SIDES = (MASTER, SLAVE)


@dataclass(frozen=True)
class Part:
    """A driver class and its validated options."""

    driver: Any
    options: BaseModel


@dataclass(frozen=True)
class Configuration:
    """A file as read: the system, and the drivers of the sides asked for; None for a side that was not."""

    path: Path
    system: System
    device: Part | None
    robot: Part | None


def load(path: Path, overrides: Iterable[str] = (), sides: Iterable[str] = SIDES) -> Configuration:
    """Read and validate a file.

    A relative path within the file is meant from the file's folder, one in an override from the working directory.

    Args:
        path: the YAML file.
        overrides: "path.to.key=value" each, applied in order; the value is YAML.
        sides: whose drivers are imported and checked: a host needs no library of the other side.

    Raises:
        ConfigurationError: for whatever is wrong with the file, an override or a value.
    """
    content = parse(path)
    overridden = {override(content, text) for text in overrides}
    try:
        system = System.model_validate(content)
        system = settle(system, path.parent, overridden)
        device = robot = None
        if MASTER in sides:
            device = _part(devices, system.master.device, ("master", "device"), path.parent, overridden)
        if SLAVE in sides:
            robot = _part(robots, system.slave.robot, ("slave", "robot"), path.parent, overridden)
        _check_security(system)
    except ValidationError as error:
        raise ConfigurationError(f"{path}: {describe(error, System, ())}") from None
    except ConfigurationError as error:
        raise ConfigurationError(f"{path}: {error}") from None
    return Configuration(path, system, device, robot)


def _check_security(system: System) -> None:
    """Refuse to leave hardware to every user of this host: without a key, any of them can take part in the session.

    Raises:
        ConfigurationError: there is a hardware driver, and no key.
    """
    if system.link.security != "none":
        return
    sides = (devices, "master.device", system.master.device), (robots, "slave.robot", system.slave.robot)
    for table, where, settings in sides:
        if table.is_hardware(settings.driver):
            raise ConfigurationError(
                f"link.security: none would let every user of this host move {where} {settings.driver}; "
                "write session (weberlink loopback makes a key), or psk with key_file (weberlink keygen KEYFILE)"
            )


def _part(
    table: Any, settings: DriverSettings, where: tuple[str, ...], folder: Path, overridden: Iterable[str]
) -> Part:
    """Find a driver in a table of drivers, and check the options that are its own."""
    try:
        driver = table.load(settings.driver)
    except ValueError as error:
        raise ConfigurationError(f"{'.'.join(where)}.{error}") from None
    except ImportError as error:
        raise ConfigurationError(
            f"{'.'.join(where)}.driver: {settings.driver} needs a package that is not installed: {error.name}"
        ) from None
    if hasattr(driver, "NEEDS"):
        package, extra = driver.NEEDS
        need(package, extra, f"{'.'.join(where)}.driver: {settings.driver}")
    options = _validate(settings.options, driver.Options, where)
    return Part(driver, settle(options, folder, set(overridden), where))


def _validate(options: Mapping[str, Any], model: type[BaseModel], where: tuple[str, ...]) -> BaseModel:
    try:
        return model.model_validate(options)
    except ValidationError as error:
        raise ConfigurationError(describe(error, model, where)) from None
