"""Read and validate a configuration file, with the options of the drivers of each side."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from operator import is_not
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from weberlink.config.cameras import CAMERAS
from weberlink.config.document import override, parse
from weberlink.config.errors import ConfigurationError, require_package, validated
from weberlink.config.finders import FINDERS
from weberlink.config.model import DriverSettings, System
from weberlink.master.devices import DEVICES, LEADERS
from weberlink.order import MASTER, SIDES, SLAVE
from weberlink.registry import Registry, is_hardware
from weberlink.slave.robots import FOLLOWERS, ROBOTS

SECTIONS = {MASTER: "master.device", SLAVE: "slave.robot"}  # where a file names the driver of a side
DRIVERS: Mapping[str, Sequence[Registry[Any]]] = {
    "master.device": (DEVICES, LEADERS),
    "slave.robot": (ROBOTS, FOLLOWERS),
    "slave.cameras": (CAMERAS,),
    "link.finder": (FINDERS,),
}
"""Drivers by the section of a file that names one; of arms led and followed joint by joint in the last table."""


@dataclass(frozen=True)
class Part:
    """A driver class and its validated options."""

    driver: Any
    options: BaseModel


@dataclass(frozen=True)
class Configuration:
    """A validated file. `device` or `robot` is None if that side was not asked for, `finder` and `cameras` if the file
    has none."""

    path: Path
    system: System
    device: Part | None
    robot: Part | None
    finder: Part | None = None
    cameras: Part | None = None

    @property
    def finds_path(self) -> bool:
        """Whether a path to the other host is found, which else has the address of the file."""
        return self.finder is not None and self.finder.driver.finds_path(self.finder.options)


def load(path: Path, overrides: Iterable[str] = (), sides: Iterable[str] = SIDES) -> Configuration:
    """Read and validate a file; raises ConfigurationError if the file, an override or a value is wrong.

    Relative paths start at the folder of the file, those in an override at the working directory.

    Args:
        path: the YAML file.
        overrides: "path.to.key=value" each, applied in order; the value is YAML.
        sides: sides whose drivers are imported and checked, so that a host needs no library of the other side.
    """
    content = parse(path)
    overridden = {override(content, text) for text in overrides}
    try:
        system: System = make_absolute(validated(System, content), path.parent, overridden)
        named = {
            "master.device": system.master.device if MASTER in sides else None,
            "slave.robot": system.slave.robot if SLAVE in sides else None,
            "link.finder": system.link.finder,
            "slave.cameras": system.slave.cameras,
        }
        parts: dict[str, Part] = {}
        for where, settings in named.items():
            if settings is None:
                continue
            parts[where] = part = load_part(_table(where, system), settings, where, path.parent, overridden)
            may_move = where in ("master.device", "slave.robot") and is_hardware(part.driver)
            if may_move and system.link.security == "none":
                raise ConfigurationError(  # noqa: TRY301 - in one line with the file, as the others
                    f"link.security: none lets every user of this host move {where} {settings.driver}; "
                    "write session (weberlink loopback makes a key), or psk with key_file (weberlink keygen KEYFILE)"
                )
    except ConfigurationError as error:
        raise ConfigurationError(f"{path}: {error}") from None
    return Configuration(path, system, *map(parts.get, named))


def load_device(configuration: Configuration) -> Part:
    """The device of the file, also where only the robot's side was loaded; raises ConfigurationError if its driver
    cannot be imported here, or an option is wrong."""
    if configuration.device is not None:
        return configuration.device
    system = configuration.system
    table = _table("master.device", system)
    return load_part(table, system.master.device, "master.device", configuration.path.parent, ())


def _table(where: str, system: System) -> Registry[Any]:
    return DRIVERS[where][0 if system.codec.joints is None else -1]


def load_part(
    table: Registry[Any], settings: DriverSettings, where: str, folder: Path, overridden: Collection[str]
) -> Part:
    """Find a driver in a table of drivers, and validate its options."""
    name, field = settings.driver, f"{where}.driver"
    try:
        driver = table.load(name)
    except ValueError as error:
        is_arm = any(name in each for each in DRIVERS[where][1:] if each is not table)
        why = f"{name} is an arm, and needs its joints: codec.joints (docs/arms/)" if is_arm else error
        raise ConfigurationError(f"{field}: {why}") from None
    except ImportError as error:
        raise ConfigurationError(f"{field}: {name} needs a package that is not installed: {error.name}") from None
    if not (isinstance(getattr(driver, "Options", None), type) and issubclass(driver.Options, BaseModel)):
        why = "has no Options, a pydantic model of its options; see docs/how-to/driver.md"
        raise ConfigurationError(f"{field}: {name} {why}")
    if hasattr(driver, "NEEDS"):
        package, extra = driver.NEEDS
        require_package(package, extra, f"{field}: {name}")
    options = validated(driver.Options, settings.options, *where.split("."))
    return Part(driver, make_absolute(options, folder, overridden, where))


def make_absolute(value: Any, folder: Path, overridden: Collection[str], where: str = "") -> Any:
    """Settings, or one of them at the path `where` in the file, in which every path is absolute: below the folder, or
    of the `overridden` fields, which were set on the command line, below the working directory."""

    def absolute(name: str | int, each: Any) -> Any:
        return make_absolute(each, folder, overridden, f"{where}.{name}".removeprefix("."))

    if isinstance(value, Path):
        return ((Path.cwd() if where in overridden else folder) / value).resolve()
    if isinstance(value, tuple):
        made = tuple(absolute(place, each) for place, each in enumerate(value))
        return made if any(map(is_not, made, value)) else value
    if not isinstance(value, BaseModel):
        return value
    changed = {name: made for name, each in value if (made := absolute(name, each)) is not each}
    return value.model_copy(update=changed) if changed else value
