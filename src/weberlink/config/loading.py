"""Read and validate a configuration file, with the options of the drivers of each side."""

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from weberlink.config import finders
from weberlink.config.document import override, parse
from weberlink.config.errors import ConfigurationError, describe, require_package
from weberlink.config.model import DriverSettings, System
from weberlink.master import devices
from weberlink.order import MASTER, SIDES, SLAVE
from weberlink.registry import is_hardware
from weberlink.slave import robots

M = TypeVar("M", bound=BaseModel)

__all__ = ["MASTER", "SIDES", "SLAVE", "Configuration", "Part", "load", "load_device", "make_absolute"]


@dataclass(frozen=True)
class Part:
    """A driver class and its validated options."""

    driver: Any
    options: BaseModel


@dataclass(frozen=True)
class Configuration:
    """A validated file. `device` or `robot` is None if that side was not asked for, `finder` if the file has none."""

    path: Path
    system: System
    device: Part | None
    robot: Part | None
    finder: Part | None = None

    @property
    def finds_path(self) -> bool:
        """Whether a path to the other host is found, which else has the address of the file."""
        return self.finder is not None and self.finder.driver.finds_path(self.finder.options)


def load(path: Path, overrides: Iterable[str] = (), sides: Iterable[str] = SIDES) -> Configuration:
    """Read and validate a file.

    Relative paths start at the folder of the file, those in an override at the working directory.

    Args:
        path: the YAML file.
        overrides: "path.to.key=value" each, applied in order; the value is YAML.
        sides: sides whose drivers are imported and checked, so that a host needs no library of the other side.

    Raises:
        ConfigurationError: the file, an override or a value is wrong.
    """
    content = parse(path)
    overridden = {override(content, text) for text in overrides}
    try:
        system = System.model_validate(content)
        system = make_absolute(system, path.parent, overridden)
        device = robot = finder = None
        if MASTER in sides:
            table = _tables(system)[MASTER]
            device = _part(table, system.master.device, ("master", "device"), path.parent, overridden)
        if SLAVE in sides:
            table = _tables(system)[SLAVE]
            robot = _part(table, system.slave.robot, ("slave", "robot"), path.parent, overridden)
        if system.link.finder is not None:
            finder = _part(finders, system.link.finder, ("link", "finder"), path.parent, overridden)
        _check_security(system, device, robot)
    except ValidationError as error:
        raise ConfigurationError(f"{path}: {describe(error, System, ())}") from None
    except ConfigurationError as error:
        raise ConfigurationError(f"{path}: {error}") from None
    return Configuration(path, system, device, robot, finder)


def load_device(configuration: Configuration) -> Part:
    """The device of the file, also where only the robot's side was loaded.

    Raises:
        ConfigurationError: its driver cannot be imported here, or an option is wrong.
    """
    if configuration.device is not None:
        return configuration.device
    system = configuration.system
    return _part(_tables(system)[MASTER], system.master.device, ("master", "device"), configuration.path.parent, ())


def _tables(system: System) -> dict[str, Any]:
    """The table of the drivers of each side: devices and robots, or arms led and followed joint by joint."""
    if system.codec.joints is None:
        return {MASTER: devices, SLAVE: robots}
    from weberlink.master.devices import leaders  # noqa: PLC0415 - for arms alone
    from weberlink.slave.robots import followers  # noqa: PLC0415 - for arms alone

    return {MASTER: leaders, SLAVE: followers}


def _check_security(system: System, device: Part | None, robot: Part | None) -> None:
    """Refuse hardware without a key: any user of this host could then join the session.

    Each end answers for its own hardware, so that neither imports the other's driver.

    Raises:
        ConfigurationError: there is a hardware driver, and no key.
    """
    if system.link.security != "none":
        return
    for part, where, name in (
        (device, "master.device", system.master.device.driver),
        (robot, "slave.robot", system.slave.robot.driver),
    ):
        if part is not None and is_hardware(part.driver):
            raise ConfigurationError(
                f"link.security: none lets every user of this host move {where} {name}; "
                "write session (weberlink loopback makes a key), or psk with key_file (weberlink keygen KEYFILE)"
            )


def _part(
    table: Any, settings: DriverSettings, where: tuple[str, ...], folder: Path, overridden: Collection[str]
) -> Part:
    """Find a driver in a table of drivers, and validate its options."""
    try:
        driver = table.load(settings.driver)
    except ValueError as error:
        hint = f"driver: {settings.driver} is an arm, and needs its joints: codec.joints (docs/arms/)"
        why = hint if settings.driver in _arms(table) else str(error)
        raise ConfigurationError(f"{'.'.join(where)}.{why}") from None
    except ImportError as error:
        raise ConfigurationError(
            f"{'.'.join(where)}.driver: {settings.driver} needs a package that is not installed: {error.name}"
        ) from None
    if not (isinstance(getattr(driver, "Options", None), type) and issubclass(driver.Options, BaseModel)):
        raise ConfigurationError(
            f"{'.'.join(where)}.driver: {settings.driver} has no Options, a pydantic model of its options; "
            "see docs/how-to/driver.md"
        )
    if hasattr(driver, "NEEDS"):
        package, extra = driver.NEEDS
        require_package(package, extra, f"{'.'.join(where)}.driver: {settings.driver}")
    options = _validate(settings.options, driver.Options, where)
    return Part(driver, make_absolute(options, folder, overridden, where))


def _arms(table: Any) -> Collection[str]:
    """Names of the arms of a side, where its table is that of other drivers."""
    from weberlink.master.devices import leaders  # noqa: PLC0415 - for a message
    from weberlink.slave.robots import followers  # noqa: PLC0415 - for a message

    arms: dict[Any, Collection[str]] = {devices: leaders.LEADERS, robots: followers.FOLLOWERS}
    return arms.get(table, ())


def _validate(options: Mapping[str, Any], model: type[BaseModel], where: tuple[str, ...]) -> BaseModel:
    try:
        return model.model_validate(options)
    except ValidationError as error:
        raise ConfigurationError(describe(error, model, where)) from None


def make_absolute(model: M, folder: Path, overridden: Collection[str], where: tuple[str, ...] = ()) -> M:
    """A copy in which every path is absolute.

    Args:
        model: validated settings.
        folder: what a relative path in the file is relative to.
        overridden: fields set on the command line, whose paths are relative to the working directory.
        where: path of the model in the file.
    """
    absolute: M = _make_absolute(model, folder, overridden, where)
    return absolute


def _make_absolute(model: Any, folder: Path, overridden: Collection[str], where: tuple[str, ...]) -> Any:
    if isinstance(model, Path):
        base = Path.cwd() if ".".join(where) in overridden else folder
        return (base / model).resolve()
    if isinstance(model, tuple):
        return tuple(_make_absolute(item, folder, overridden, (*where, str(i))) for i, item in enumerate(model))
    if isinstance(model, BaseModel):
        values = {name: getattr(model, name) for name in (*type(model).model_fields, *(model.model_extra or {}))}
        changed = {
            name: absolute
            for name, value in values.items()
            if (absolute := _make_absolute(value, folder, overridden, (*where, name))) is not value
        }
        return model.model_copy(update=changed) if changed else model
    return model
