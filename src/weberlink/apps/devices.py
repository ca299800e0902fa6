"""The `devices` command: the drivers of both sides, what is plugged in, and the line that removes what is in the way.

Knows the contract of drivers and no driver. Opens nothing.
"""

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from importlib.metadata import entry_points
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Protocol

from rich.console import Console
from rich.table import Table
from rich.text import Text

from weberlink.apps import rules
from weberlink.hardware.discovery import PluggedDevice
from weberlink.master import devices
from weberlink.slave import robots

READY = "ready"
NOTHING = "nothing plugged in"
NO_PERMISSION = "no permission"
NO_RULES = "rules not installed"
NO_EXTRA = "extra missing"
UNUSABLE = "not usable"
BROKEN = "broken"
COLOURS = {READY: "green", NOTHING: "dim"}

LATENCY_MS = 1
"""What the rules set the latency timer of an FTDI chip to."""


class DriverTable(Protocol):
    """The drivers of one side: `weberlink.master.devices` and `weberlink.slave.robots`."""

    def drivers(self) -> dict[str, str]: ...

    def load(self, name: str) -> Any: ...


@dataclass(frozen=True)
class Side:
    """Where the drivers of one side come from, and where a configuration names them.

    Args:
        table: of the drivers.
        group: of the entry points of other packages.
        section: of a configuration.
    """

    table: DriverTable
    group: str
    section: str


SIDES: Mapping[str, Side] = {
    "master": Side(devices, "weberlink.devices", "master.device"),
    "slave": Side(robots, "weberlink.robots", "slave.robot"),
}


@dataclass(frozen=True)
class Host:
    """What is asked of this machine.

    Args:
        accessible: whether this user may read and write a path.
        groups: that this process is in.
        rules: folders where udev looks for rules.
        ttys: what the kernel says of serial ports.
        links: to serial ports, by names that do not depend on what was plugged in first.
    """

    accessible: Callable[[str], bool] = lambda path: os.access(path, os.R_OK | os.W_OK)
    groups: frozenset[int] = field(default_factory=lambda: frozenset((*os.getgroups(), os.getegid())))
    rules: Sequence[Path] = rules.FOLDERS
    ttys: Path = Path("/sys/class/tty")
    links: Path = Path("/dev/serial/by-id")


@dataclass(frozen=True)
class Row:
    """One driver as it stands here.

    Args:
        side: "master" or "slave".
        driver: its name.
        package: that it comes from; None for a built-in one.
        kind: "virtual" or "hardware"; None where it could not be loaded.
        extra: of this project that it needs; None for none.
        state: one of those above.
        plugged: what it could drive.
        advice: what helps, a line each.
    """

    side: str
    driver: str
    package: str | None
    kind: str | None
    extra: str | None
    state: str
    plugged: tuple[PluggedDevice, ...] = ()
    advice: tuple[str, ...] = ()


@dataclass(frozen=True)
class Survey:
    """What was found, and how it is shown."""

    rows: Sequence[Row]
    rules_installed: bool

    @property
    def advice(self) -> dict[str, list[str]]:
        """What helps, and the drivers that it helps."""
        lines: dict[str, list[str]] = {}
        for row in self.rows:
            for line in row.advice:
                lines.setdefault(line, []).append(row.driver)
        return lines

    @property
    def document(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "drivers": [asdict(row) for row in self.rows],
            "rules_installed": self.rules_installed,
            "advice": [{"line": line, "drivers": drivers} for line, drivers in self.advice.items()],
        }

    def show(self, console: Console) -> None:
        """The table, and below it one line for each thing in the way."""
        table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
        table.add_column("side", no_wrap=True)
        table.add_column("driver", max_width=20, overflow="fold")
        table.add_column("kind", no_wrap=True)
        table.add_column("state", no_wrap=True)
        table.add_column("plugged in", overflow="fold")
        for row in self.rows:
            table.add_row(
                row.side,
                row.driver if row.package is None else f"{row.driver} (of {row.package})",
                f"extra {row.extra}" if row.extra else row.kind or "-",
                Text(row.state, style=COLOURS.get(row.state, "red")),
                Text("\n".join(map(str, row.plugged)) or "-"),
            )
        console.print(table)
        for line, drivers in self.advice.items():
            console.print(Text(f"{', '.join(drivers)}: {line}"), soft_wrap=True)  # is copied, so must not be broken


def survey(host: Host | None = None, sides: Mapping[str, Side] = SIDES) -> Survey:
    """Look at every driver of both sides and at what is plugged in."""
    here = host or Host()
    has_rules = rules.installed(here.rules)
    rows: list[Row] = []
    for name, side in sides.items():
        packages = _packages(side)
        looks = (_Look(name, side, each, packages.get(each), here, has_rules) for each in sorted(side.table.drivers()))
        rows.extend(look.row() for look in looks)
    return Survey(rows, has_rules)


@dataclass(frozen=True)
class _Look:
    """At one driver."""

    name: str
    side: Side
    driver: str
    package: str | None
    host: Host
    has_rules: bool

    def row(self) -> Row:
        try:
            driver = self.side.table.load(self.driver)
        except Exception as error:  # whatever another package does when it is imported
            return self._row(None, None, BROKEN, (), f"cannot be loaded: {_in_words(error)}")
        kind = "hardware" if hasattr(driver, "plugged") else "virtual"
        package, extra = getattr(driver, "NEEDS", (None, None))
        if package is not None and find_spec(package) is None:
            return self._row(kind, extra, NO_EXTRA, (), f'pip install "weberlink[{extra}]"')
        if kind == "virtual":
            return self._row(kind, extra, READY)
        return self._hardware(driver, extra)

    def _hardware(self, driver: Any, extra: str | None) -> Row:
        try:
            plugged = tuple(driver.plugged())
        except Exception as error:  # a listing that fails must not hide the other drivers
            return self._row("hardware", extra, BROKEN, (), f"what is plugged in cannot be listed: {_in_words(error)}")
        states = [self._state(found) for found in plugged]
        advice = [line for found, state in zip(plugged, states, strict=True) for line in self._advice(found, state)]
        usable = [found for found, state in zip(plugged, states, strict=True) if state == READY]
        if len(usable) > 1:
            ports = " or ".join(f"port: {self._lasting(found.path)}" for found in usable)
            advice.append(f"{len(usable)} are plugged in; say which under {self.side.section}: {ports}")
        state = READY if usable else states[0] if states else NOTHING
        return self._row("hardware", extra, state, plugged, *advice)

    def _row(
        self, kind: str | None, extra: str | None, state: str, plugged: tuple[PluggedDevice, ...] = (), *advice: str
    ) -> Row:
        return Row(self.name, self.driver, self.package, kind, extra, state, plugged, advice)

    def _state(self, found: PluggedDevice) -> str:
        if found.path.startswith("/") and not self.host.accessible(found.path):
            # The rules name the devices of the built-in drivers alone.
            return NO_PERMISSION if self.has_rules or self.package is not None else NO_RULES
        return READY if found.problem is None else UNUSABLE

    def _advice(self, found: PluggedDevice, state: str) -> Iterator[str]:
        if state == NO_RULES:
            yield rules.install_line()
        elif state == NO_PERMISSION:
            yield rules.group_line(found.path, self.host.groups) or (
                f"unplug {found.path} and plug it in again: it has been there for longer than the rules"
                if self.package is None
                else f"no permission to open {found.path}; {self.package} says which udev rule it takes"
            )
        elif state == UNUSABLE:
            yield f"{found.path}: {found.problem}"
        else:
            yield from self._latency(found)

    def _latency(self, found: PluggedDevice) -> Iterator[str]:
        """A slow latency timer, which only chips of FTDI have."""
        timer = self.host.ttys / Path(found.path).name / "device" / "latency_timer"
        try:
            latency_ms = int(timer.read_text())
        except (OSError, ValueError):
            return
        if latency_ms > LATENCY_MS:
            by_hand = f"echo {LATENCY_MS} | sudo tee {timer}"
            line = by_hand if self.has_rules or self.package is not None else rules.install_line()
            yield f"{found.path} holds replies back for {latency_ms} ms (latency timer): {line}"

    def _lasting(self, path: str) -> str:
        """A name of a port that is the same after the next start, if there is one."""
        try:
            links = sorted(self.host.links.iterdir())
        except OSError:
            return path
        return next((str(link) for link in links if os.path.realpath(link) == os.path.realpath(path)), path)


def _packages(side: Side) -> dict[str, str]:
    """Name of a driver to the package that brings it, where that is not this one."""
    built_in = getattr(side.table, "BUILT_IN", {})
    return {
        entry.name: entry.dist.name if entry.dist is not None else entry.value
        for entry in entry_points(group=side.group)
        if entry.name not in built_in
    }


def _in_words(error: Exception) -> str:
    return f"{type(error).__name__}: {' '.join(str(error).split())}".rstrip(": ")
