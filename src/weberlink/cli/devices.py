"""The `device list` command: lists drivers and the hardware plugged in, and suggests fixes. It opens no device."""

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table
from rich.text import Text

from weberlink.cli import rules
from weberlink.config.loading import DRIVERS, SECTIONS
from weberlink.hardware.discovery import PluggedDevice
from weberlink.installation import install_line
from weberlink.registry import PartError, Registry, in_words, is_hardware

READY = "ready"
NOTHING = "nothing plugged in"
UNSEEN = "cannot be listed"
"""Of a driver without `plugged`, or whose `plugged` returns None: its device is on a network, for example."""
NO_PERMISSION = "no permission"
NO_RULES = "rules not installed"
NO_EXTRA = "extra missing"
ABSENT = "not installed"  # of a driver of a guest of this project
UNUSABLE = "not usable"
BROKEN = "broken"
COLOURS = {READY: "green", NOTHING: "dim", UNSEEN: "dim"}

LATENCY_MS = 1  # value that the rules set the latency timer of an FTDI chip to
TTYS, LINKS = Path("/sys/class/tty"), Path("/dev/serial/by-id")


@dataclass(frozen=True)
class DeviceAccess:
    """Access to this machine, replaceable in tests."""

    accessible: Callable[[str], bool] = lambda path: os.access(path, os.R_OK | os.W_OK)
    rules: Sequence[Path] = rules.FOLDERS


@dataclass(frozen=True)
class DriverStatus:
    """State of one driver on this machine."""

    side: str
    driver: str
    package: str | None  # None for a built-in driver
    kind: str | None  # "virtual" or "hardware"; None if it could not be loaded
    extra: str | None  # of this project, which it needs
    state: str
    plugged: tuple[PluggedDevice, ...] = ()
    advice: tuple[str, ...] = ()
    tier: str | None = None  # what a driver of hardware was tried on; None if it does not say


@dataclass(frozen=True)
class Survey:
    """State of all drivers."""

    drivers: Sequence[DriverStatus]
    rules_installed: bool

    @property
    def advice(self) -> dict[str, list[str]]:
        """Suggested fixes, and the drivers that each is for."""
        lines: dict[str, list[str]] = {}
        for each in self.drivers:
            for line in each.advice:
                lines.setdefault(line, []).append(each.driver)
        return lines

    @property
    def document(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "drivers": [asdict(each) for each in self.drivers],
            "rules_installed": self.rules_installed,
            "advice": [{"line": line, "drivers": drivers} for line, drivers in self.advice.items()],
        }

    def show(self, console: Console) -> None:
        """Print a table, and below it one line for each fix."""
        table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
        table.add_column("side", no_wrap=True)
        table.add_column("driver", max_width=24, overflow="fold")
        table.add_column("tried on", no_wrap=True)
        table.add_column("state", no_wrap=True)
        table.add_column("plugged in", overflow="fold")
        for each in self.drivers:
            table.add_row(
                each.side,
                each.driver if each.package is None else f"{each.driver}\nof {each.package}",
                (each.tier or "not stated") if each.kind == "hardware" else each.kind or "-",
                Text(each.state, style=COLOURS.get(each.state, "red")),
                Text("\n".join(map(str, each.plugged)) or "-"),
            )
        console.print(table)
        for line, drivers in self.advice.items():
            console.print(Text(f"{', '.join(drivers)}: {line}"), soft_wrap=True)  # a line to copy must not be wrapped


def survey(host: DeviceAccess | None = None, tables: Mapping[str, Sequence[Registry[Any]]] = DRIVERS) -> Survey:
    """List every driver of both sides and the hardware plugged in."""
    here = host or DeviceAccess()
    has_rules = rules.installed(here.rules)
    drivers: list[DriverStatus] = []
    for side, table in ((side, table) for side, section in SECTIONS.items() for table in tables.get(section, ())):
        drivers.extend(_status(side, table, name, here, has_rules) for name in sorted(table))
        drivers.extend(
            DriverStatus(side, driver, f"weberlink-{guest}", None, guest, ABSENT, (), (install_line(guest),))
            for driver, guest in sorted(table.absent().items())
        )
    return Survey(drivers, has_rules)


def _status(side: str, table: Registry[Any], name: str, host: DeviceAccess, has_rules: bool) -> DriverStatus:
    """Examine one driver."""
    package = table.distribution(name)
    try:
        driver = table[name]
        if not isinstance(driver, type):
            raise TypeError(f"{driver!r} is no class")  # noqa: TRY301 - as an error of its import
    except Exception as error:  # another package may raise anything at import
        why = str(error) if isinstance(error, PartError) else f"cannot be loaded: {in_words(error)}"
        return DriverStatus(side, name, package, None, None, BROKEN, (), (why,))
    needed, extra = getattr(driver, "NEEDS", (None, None))
    kind, tier = ("hardware", getattr(driver, "TIER", None)) if is_hardware(driver) else ("virtual", None)
    found = DriverStatus(side, name, package, kind, extra, READY, tier=tier)
    if needed is not None and find_spec(needed) is None:
        return replace(found, state=NO_EXTRA, advice=(install_line(str(extra)),))
    if kind == "virtual":
        return found
    try:
        listed = driver.plugged() if hasattr(driver, "plugged") else None
    except Exception as error:  # a listing that fails must not hide the other drivers
        return replace(found, state=BROKEN, advice=(f"plugged devices cannot be listed: {in_words(error)}",))
    if listed is None:
        return replace(found, state=UNSEEN)
    plugged = tuple(listed)
    states = [_device_state(device, package, host, has_rules) for device in plugged]
    advice = [line for _, line in states if line]
    usable = [device for device, (state, _) in zip(plugged, states, strict=True) if state == READY]
    if len(usable) > 1:
        choices = " or ".join(f"port: {_lasting(device.path)}" for device in usable)
        choices = getattr(driver, "CHOSEN_BY", choices)
        advice.append(f"{len(usable)} are plugged in; say which under {SECTIONS[side]}: {choices}")
    state = READY if usable else states[0][0] if states else NOTHING
    return replace(found, state=state, plugged=plugged, advice=tuple(advice))


def _device_state(
    device: PluggedDevice, package: str | None, host: DeviceAccess, has_rules: bool
) -> tuple[str, str | None]:
    """State of a device that is plugged in, and what to do about it."""
    path, covered = device.path, rules.covers(package)
    if path.startswith("/") and not host.accessible(path):
        if covered and not has_rules:
            return NO_RULES, rules.install_line()
        group = rules.group_line(path)
        if group is None and covered:
            group = f"unplug {path} and plug it in again: it was plugged in before the rules were installed"
        return NO_PERMISSION, group or f"no permission to open {path}; {package} documents the udev rule that it needs"
    if device.problem is not None:
        return UNUSABLE, f"{path}: {device.problem}"
    timer = TTYS / Path(path).name / "device" / "latency_timer"  # which only FTDI chips have
    try:
        latency_ms = int(timer.read_text())
    except (OSError, ValueError):
        return READY, None
    if latency_ms <= LATENCY_MS:
        return READY, None
    by_hand = f"echo {LATENCY_MS} | sudo tee {timer}"
    line = by_hand if has_rules or not covered else rules.install_line()
    return READY, f"{path} delays replies by {latency_ms} ms (latency timer): {line}"


def _lasting(path: str) -> str:
    """The stable name of a port, if it has one."""
    try:
        named = sorted(LINKS.iterdir())
    except OSError:
        return path
    return next((str(link) for link in named if os.path.realpath(link) == os.path.realpath(path)), path)
