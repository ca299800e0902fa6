"""The `device list` command: lists drivers and the hardware plugged in, and suggests fixes. It opens no device."""

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from importlib.metadata import entry_points
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table
from rich.text import Text

from weberlink.cli import rules
from weberlink.hardware.discovery import PluggedDevice
from weberlink.installation import install_line
from weberlink.master.devices import DEVICES
from weberlink.master.devices.leaders import LEADERS
from weberlink.registry import PartError, Registry, in_words, is_hardware
from weberlink.slave.robots import ROBOTS
from weberlink.slave.robots.followers import FOLLOWERS

READY = "ready"
NOTHING = "nothing plugged in"
UNSEEN = "cannot be listed"
"""Of a driver without `plugged`, or whose `plugged` returns None: its device is on a network, for example."""
NO_PERMISSION = "no permission"
NO_RULES = "rules not installed"
NO_EXTRA = "extra missing"
ABSENT = "not installed"
"""Of a driver of a guest of this project."""
UNUSABLE = "not usable"
BROKEN = "broken"
COLOURS = {READY: "green", NOTHING: "dim", UNSEEN: "dim"}

LATENCY_MS = 1
"""Value that the rules set the latency timer of an FTDI chip to."""


SIDES: Mapping[str, Registry[Any]] = {"master": DEVICES, "slave": ROBOTS}
ARMS: Mapping[str, Registry[Any]] = {"master": LEADERS, "slave": FOLLOWERS}
"""Drivers of arms led and followed joint by joint."""
TABLES: Mapping[str, Sequence[Registry[Any]]] = {side: (SIDES[side], ARMS[side]) for side in SIDES}
SECTIONS = {"master": "master.device", "slave": "slave.robot"}
"""Where a configuration names the driver of a side."""


@dataclass(frozen=True)
class DeviceAccess:
    """Access to this machine, replaceable in tests."""

    accessible: Callable[[str], bool] = lambda path: os.access(path, os.R_OK | os.W_OK)
    groups: frozenset[int] = field(default_factory=lambda: frozenset((*os.getgroups(), os.getegid())))
    rules: Sequence[Path] = rules.FOLDERS
    ttys: Path = Path("/sys/class/tty")
    links: Path = Path("/dev/serial/by-id")


@dataclass(frozen=True)
class DriverStatus:
    """State of one driver on this machine."""

    side: str
    driver: str
    package: str | None
    """None for a built-in driver."""
    kind: str | None
    """"virtual" or "hardware"; None if it could not be loaded."""
    extra: str | None
    """The extra of this project that it needs."""
    state: str
    plugged: tuple[PluggedDevice, ...] = ()
    advice: tuple[str, ...] = ()
    tier: str | None = None
    """What a driver of hardware was tried on; None if it does not say, or is no driver of hardware."""


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


def survey(host: DeviceAccess | None = None, sides: Mapping[str, Sequence[Registry[Any]]] = TABLES) -> Survey:
    """List every driver of both sides and the hardware plugged in."""
    here = host or DeviceAccess()
    has_rules = rules.installed(here.rules)
    drivers: list[DriverStatus] = []
    for side, table in ((side, table) for side, tables in sides.items() for table in tables):
        packages = _packages(table)
        drivers.extend(
            _Inspection(side, table, driver, packages.get(driver), here, has_rules).status() for driver in sorted(table)
        )
        drivers.extend(
            DriverStatus(side, driver, f"weberlink-{guest}", None, guest, ABSENT, (), (install_line(guest),))
            for driver, guest in sorted(table.absent().items())
        )
    return Survey(drivers, has_rules)


@dataclass(frozen=True)
class _Inspection:
    """Examines one driver."""

    side: str
    table: Registry[Any]
    driver: str
    package: str | None
    host: DeviceAccess
    has_rules: bool

    def status(self) -> DriverStatus:
        try:
            driver = self.table[self.driver]
            if not isinstance(driver, type):
                raise TypeError(f"{driver!r} is no class")  # noqa: TRY301 - as an error of its import
        except Exception as error:  # another package may raise anything at import
            why = str(error) if isinstance(error, PartError) else f"cannot be loaded: {in_words(error)}"
            return self._status(None, None, BROKEN, (), why)
        kind = "hardware" if is_hardware(driver) else "virtual"
        package, extra = getattr(driver, "NEEDS", (None, None))
        if package is not None and find_spec(package) is None:
            return self._status(kind, extra, NO_EXTRA, (), install_line(str(extra)))
        if kind == "virtual":
            return self._status(kind, extra, READY)
        return self._hardware(driver, extra)

    def _hardware(self, driver: Any, extra: str | None) -> DriverStatus:
        try:
            listed = driver.plugged() if hasattr(driver, "plugged") else None
        except Exception as error:  # a listing that fails must not hide the other drivers
            return self._status("hardware", extra, BROKEN, (), f"plugged devices cannot be listed: {in_words(error)}")
        if listed is None:
            return self._status("hardware", extra, UNSEEN)
        plugged = tuple(listed)
        states = [self._state(found) for found in plugged]
        advice = [line for found, state in zip(plugged, states, strict=True) for line in self._advice(found, state)]
        usable = [found for found, state in zip(plugged, states, strict=True) if state == READY]
        if len(usable) > 1:
            choices = " or ".join(f"port: {self._lasting(found.path)}" for found in usable)
            choices = getattr(driver, "CHOSEN_BY", choices)
            advice.append(f"{len(usable)} are plugged in; say which under {SECTIONS[self.side]}: {choices}")
        state = READY if usable else states[0] if states else NOTHING
        return self._status("hardware", extra, state, plugged, *advice)

    def _status(
        self, kind: str | None, extra: str | None, state: str, plugged: tuple[PluggedDevice, ...] = (), *advice: str
    ) -> DriverStatus:
        tier = getattr(self.table[self.driver], "TIER", None) if kind == "hardware" else None
        return DriverStatus(self.side, self.driver, self.package, kind, extra, state, plugged, advice, tier)

    def _state(self, found: PluggedDevice) -> str:
        if found.path.startswith("/") and not self.host.accessible(found.path):
            return NO_PERMISSION if self.has_rules or not rules.covers(self.package) else NO_RULES
        return READY if found.problem is None else UNUSABLE

    def _advice(self, found: PluggedDevice, state: str) -> Iterator[str]:
        if state == NO_RULES:
            yield rules.install_line()
        elif state == NO_PERMISSION:
            yield rules.group_line(found.path, self.host.groups) or (
                f"unplug {found.path} and plug it in again: it was plugged in before the rules were installed"
                if rules.covers(self.package)
                else f"no permission to open {found.path}; {self.package} documents the udev rule that it needs"
            )
        elif state == UNUSABLE:
            yield f"{found.path}: {found.problem}"
        else:
            yield from self._latency(found)

    def _latency(self, found: PluggedDevice) -> Iterator[str]:
        """Advice for a slow latency timer, which only FTDI chips have."""
        timer = self.host.ttys / Path(found.path).name / "device" / "latency_timer"
        try:
            latency_ms = int(timer.read_text())
        except (OSError, ValueError):
            return
        if latency_ms > LATENCY_MS:
            by_hand = f"echo {LATENCY_MS} | sudo tee {timer}"
            line = by_hand if self.has_rules or not rules.covers(self.package) else rules.install_line()
            yield f"{found.path} delays replies by {latency_ms} ms (latency timer): {line}"

    def _lasting(self, path: str) -> str:
        """The stable name of a port, if it has one."""
        try:
            links = sorted(self.host.links.iterdir())
        except OSError:
            return path
        return next((str(link) for link in links if os.path.realpath(link) == os.path.realpath(path)), path)


def _packages(table: Registry[Any]) -> dict[str, str]:
    """Driver name to package, for drivers of other packages."""
    return {
        entry.name: entry.dist.name if entry.dist is not None else entry.value
        for entry in entry_points(group=table.group or "")
        if entry.name not in table.built_in
    }
