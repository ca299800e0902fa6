"""`weberlink device list`: drivers, plugged devices, suggested fixes, and the udev rules."""

import re
import stat
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

import pytest

from tests.program import document, weberlink
from weberlink.cli import rules
from weberlink.cli.devices import DeviceAccess, Survey, survey
from weberlink.cli.output import CommandError
from weberlink.hardware.discovery import PluggedDevice, UsbId
from weberlink.installation import install_line
from weberlink.master.devices import DEVICES, LEADERS
from weberlink.registry import Registry
from weberlink.slave.robots import FOLLOWERS, ROBOTS

RULES = rules.shipped()
OPEN = DeviceAccess(accessible=lambda path: True, rules=())  # a host without rules where everything may be opened


def driver(*found: str | PluggedDevice, **attributes: Any) -> Any:
    """A hardware driver with these devices plugged in."""
    plugged = [PluggedDevice(each) if isinstance(each, str) else each for each in found]
    return type("Driver", (), {"USB": (), "plugged": classmethod(lambda cls: plugged), **attributes})


def surveyed(access: DeviceAccess = OPEN, **drivers: Any) -> Survey:
    return survey(access, {"master.device": [Registry("device", drivers)]})


def test_all_drivers_are_listed_and_virtual_ones_ready() -> None:
    ended = weberlink("device", "list", "--json", "-")
    found = {(each["side"], each["driver"]): each for each in document(ended.output)["drivers"]}
    for side, tables in (("master", (DEVICES, LEADERS)), ("slave", (ROBOTS, FOLLOWERS))):
        assert {name for there, name in found if there == side} == {
            name for table in tables for name in (*table, *table.absent())
        }
    for virtual in (("master", "operator"), ("slave", "point")):
        assert (found[virtual]["kind"], found[virtual]["state"]) == ("virtual", "ready")
    assert weberlink("device", "list").status == 0


def fails(cls: Any) -> list[PluggedDevice]:
    raise OSError("no\nbus")


@pytest.mark.parametrize(
    ("candidate", "state", "advice"),
    [
        (type("Driver", (), {"NEEDS": ("no_such_package", "x")}), "extra missing", install_line("x")),
        (type("Driver", (), {"NEEDS": ("json", "x"), "COMPUTED": True}), "ready", None),
        (driver(), "nothing plugged in", None),
        (driver("/dev/p"), "ready", None),
        (driver("/dev/p", "/dev/q"), "ready", "port: /dev/p or port: /dev/q"),
        (driver(plugged=classmethod(lambda cls: None)), "cannot be listed", None),
        (driver(plugged=classmethod(fails)), "broken", "no bus"),
        (driver(PluggedDevice("/dev/p", problem="in boot mode")), "not usable", "/dev/p: in boot mode"),
    ],
)
def test_state_comes_with_its_fix(candidate: Any, state: str, advice: str | None) -> None:
    other, paddle = surveyed(paddle=candidate, other=driver()).drivers
    assert (paddle.state, other.state) == (state, "nothing plugged in")
    assert [advice in line for line in paddle.advice] == [True] * (advice is not None)


# --- permissions


@pytest.mark.parametrize(
    ("text", "state", "advice"),
    [
        (None, "rules not installed", "weberlink device rules"),
        ("# former", "rules not installed", "weberlink device rules"),
        ("", "no permission", "unplug"),
    ],
    ids=["no rules", "rules of another version", "rules"],
)
def test_no_permission_comes_with_its_fix(text: str | None, state: str, advice: str, tmp_path: Path) -> None:
    node = tmp_path / "ttyACM0"
    node.touch(0o600)
    for name, shipped in RULES.items() if text is not None else ():
        (tmp_path / name).write_text(shipped + str(text), encoding="utf-8")
    access = DeviceAccess(accessible=lambda path: False, rules=(tmp_path,))
    found = surveyed(access, paddle=driver(str(node)), other=driver(str(node)))
    assert [each.state for each in found.drivers] == [state] * 2
    (line,) = found.advice
    assert advice in line


# --- the rules


def granted(usb: UsbId) -> bool:
    """Whether a rule gives access to a device of this identity."""
    for line in "\n".join(RULES.values()).splitlines():
        vendor, product = (re.search(rf'ATTRS\{{{key}\}}=="([^"]*)"', line) for key in ("idVendor", "idProduct"))
        if 'TAG+="uaccess"' not in line or vendor is None or vendor[1] != f"{usb.vendor:04x}":
            continue
        patterns = ["*"] if product is None else product[1].split("|")
        asked = "any" if usb.product is None else f"{usb.product:04x}"
        if any(pattern == "*" or fnmatchcase(asked, pattern) for pattern in patterns):
            return True
    return False


def test_rules_cover_every_driver_and_no_other_device() -> None:
    for table in (DEVICES, ROBOTS, LEADERS, FOLLOWERS):
        for name in table:
            for usb in getattr(table.load(name), "USB", ()):
                assert granted(usb), f"no rule gives access to {usb} of {name}"
    for usb in (UsbId(0x1234, 0x0007), UsbId(0xDEAD, None)):
        assert not granted(usb)
    for name in RULES:
        assert name < "73", "73-seat-late.rules reads the tag"


@pytest.mark.parametrize(("udev", "part"), [(0, "applied"), (1, "unplug"), (None, "cannot be run")])
def test_rules_are_installed_whether_udev_applies_them_or_not(udev: int | None, part: str, tmp_path: Path) -> None:
    program, log, folder = tmp_path / "udevadm", tmp_path / "log", tmp_path / "etc" / "rules.d"
    if udev is not None:
        program.write_text(f'#!/bin/sh\necho "$@" >> {log}\nexit {udev}\n')
        program.chmod(0o755)
    assert not rules.installed([folder])
    line = rules.install(folder, str(program))
    assert line.startswith(str(folder / "49-weberlink.rules")) and ": installed" in line and part in line
    assert rules.installed([tmp_path / "none", folder])
    assert {path.name: path.read_text(encoding="utf-8") for path in folder.iterdir()} == RULES
    assert {stat.S_IMODE(path.stat().st_mode) for path in folder.iterdir()} == {0o644}
    if udev == 0:
        reload, trigger = log.read_text().splitlines()
        assert (reload, trigger.split()[:2]) == ("control --reload", ["trigger", "--action=change"])
        assert all(f"--subsystem-match={name}" in trigger for name in ("hidraw", "tty", "usb"))
    with pytest.raises(CommandError, match=r"^[^\n]*Not a directory[^\n]*$"):
        rules.install(folder / "49-weberlink.rules" / "rules.d", "true")
