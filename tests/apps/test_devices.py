"""What `weberlink devices` says of drivers, of what is plugged in, and of what is in the way."""

import grp
import io
import json
import os
import re
import shutil
import stat
import subprocess
import tomllib
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console
from typer.testing import CliRunner

from tests.system.packages import install
from tests.system.systems import CONFIGS
from weberlink.apps import rules
from weberlink.apps.devices import Host, Row, Side, Survey, survey
from weberlink.apps.rules import RulesError
from weberlink.cli import app
from weberlink.hardware.discovery import UDEV_RULES, PluggedDevice, UsbId
from weberlink.master import devices
from weberlink.slave import robots

RULES = (CONFIGS / UDEV_RULES).read_text(encoding="utf-8")


def driver(*found: PluggedDevice, **attributes: Any) -> Any:
    """A driver class of hardware, with this plugged in."""
    return type("Driver", (), {"USB": (), "plugged": classmethod(lambda cls: list(found)), **attributes})


class Table:
    """Drivers of one side; an exception stands for a driver that cannot be loaded."""

    def __init__(self, **drivers: Any) -> None:
        self.BUILT_IN = dict.fromkeys(drivers, "module:Class")
        self._drivers = drivers

    def drivers(self) -> dict[str, str]:
        return dict(self.BUILT_IN)

    def load(self, name: str) -> Any:
        found = self._drivers[name]
        if isinstance(found, Exception):
            raise found
        return found


def surveyed(host: Host | None = None, **drivers: Any) -> Survey:
    """Of a master with these drivers, on a host without rules where everything may be opened."""
    here = host or Host(accessible=lambda path: True, rules=())
    return survey(here, {"master": Side(Table(**drivers), "weberlink.none", "master.device")})


def row(host: Host | None = None, **drivers: Any) -> Row:
    (only,) = surveyed(host, **drivers).rows
    return only


def shown(found: Survey) -> str:
    """As on a terminal of 80 columns."""
    stream = io.StringIO()
    found.show(Console(file=stream, width=80))
    return stream.getvalue()


# --- the drivers there are


def test_every_driver_of_both_sides_is_listed_and_the_virtual_ones_are_ready() -> None:
    rows = {(each.side, each.driver): each for each in survey().rows}
    assert {name for side, name in rows if side == "master"} == set(devices.drivers())
    assert {name for side, name in rows if side == "slave"} == set(robots.drivers())
    for virtual in (("master", "operator"), ("master", "replay"), ("slave", "point"), ("slave", "simulated")):
        assert (rows[virtual].kind, rows[virtual].state) == ("virtual", "ready")


def test_the_document_is_json_and_says_what_the_table_says() -> None:
    found = surveyed(paddle=driver(PluggedDevice("/dev/ttyACM0", "Paddle", "17")), broken=RuntimeError("no"))
    document = json.loads(json.dumps(found.document))
    assert document == {
        "drivers": [
            {
                "side": "master", "driver": "broken", "package": None, "kind": None, "extra": None, "state": "broken",
                "plugged": [], "advice": ["cannot be loaded: RuntimeError: no"],
            },
            {
                "side": "master", "driver": "paddle", "package": None, "kind": "hardware", "extra": None,
                "state": "ready", "advice": [],
                "plugged": [{"path": "/dev/ttyACM0", "name": "Paddle", "serial_number": "17", "problem": None}],
            },
        ],
        "rules_installed": False,
        "advice": [{"line": "cannot be loaded: RuntimeError: no", "drivers": ["broken"]}],
    }  # fmt: skip
    assert "/dev/ttyACM0 Paddle" in shown(found)


def test_drivers_of_other_packages_are_marked_and_a_broken_one_is_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    install(
        tmp_path,
        "others-things",
        {"others_things_good": "class Good: pass", "others_things_bad": "import others_things_missing"},
        "[weberlink.devices]\nothers_good = others_things_good:Good\nothers_bad = others_things_bad:Bad\n"
        "operator = others_things_bad:Bad\n"
        "[weberlink.robots]\nothers_none = others_things_good:None_\nothers_odd = others_things_good\n",
    )
    monkeypatch.syspath_prepend(str(tmp_path))
    found = survey()
    rows = {each.driver: each for each in found.rows if each.driver.startswith("others")}
    assert {each.package for each in rows.values()} == {"others-things"}
    assert [rows[name].state for name in ("others_good", "others_bad", "others_none", "others_odd")] == [
        "ready", "broken", "broken", "broken",
    ]  # fmt: skip
    assert rows["others_bad"].advice == (
        "cannot be loaded: ModuleNotFoundError: No module named 'others_things_missing'",
    )
    assert "Traceback" not in shown(found)
    assert all(each.package is None for each in found.rows if not each.driver.startswith("others"))


def test_a_missing_extra_is_the_line_that_installs_it() -> None:
    found = row(virtual=type("Driver", (), {"NEEDS": ("no_such_package", "mujoco")}))
    assert (found.state, found.extra) == ("extra missing", "mujoco")
    assert found.advice == ('pip install "weberlink[mujoco]"',)
    assert row(virtual=type("Driver", (), {"NEEDS": ("json", "mujoco")})).state == "ready"


# --- what is plugged in


def test_nothing_plugged_in_is_a_state_and_nothing_in_the_way() -> None:
    found = row(paddle=driver())
    assert (found.kind, found.state, found.plugged, found.advice) == ("hardware", "nothing plugged in", (), ())


def test_a_listing_that_fails_hides_no_other_driver() -> None:
    def fails(cls: Any) -> list[PluggedDevice]:
        raise OSError("no\nbus")

    found = surveyed(paddle=driver(plugged=classmethod(fails)), other=driver())
    assert {each.driver: each.state for each in found.rows} == {"paddle": "broken", "other": "nothing plugged in"}
    assert list(found.advice) == ["what is plugged in cannot be listed: OSError: no bus"]


def test_two_alike_are_told_apart_by_names_that_last(tmp_path: Path) -> None:
    first, second = tmp_path / "ttyACM0", tmp_path / "ttyACM1"
    links = tmp_path / "by-id"
    links.mkdir()
    first.touch()
    second.touch()
    (links / "usb-Paddle_17").symlink_to(second)
    host = Host(accessible=lambda path: True, rules=(), links=links)
    found = row(host, paddle=driver(PluggedDevice(str(first)), PluggedDevice(str(second))))
    assert found.state == "ready"
    assert found.advice == (
        f"2 are plugged in; say which under master.device: port: {first} or port: {links / 'usb-Paddle_17'}",
    )


def test_what_is_in_the_way_of_one_that_is_plugged_in_is_said() -> None:
    found = row(paddle=driver(PluggedDevice("/dev/ttyACM0", problem="in boot mode; press its button")))
    assert (found.state, found.advice) == ("not usable", ("/dev/ttyACM0: in boot mode; press its button",))


# --- permissions


@pytest.fixture
def node(tmp_path: Path) -> Path:
    path = tmp_path / "ttyACM0"
    path.touch()
    return path


def refused(tmp_path: Path, *, installed: bool, groups: frozenset[int] = frozenset()) -> Host:
    """A host on which this user may open nothing."""
    if installed:
        (tmp_path / UDEV_RULES).write_text(RULES, encoding="utf-8")
    return Host(accessible=lambda path: False, rules=(tmp_path,), groups=groups)


def test_no_permission_without_the_rules_is_the_line_that_installs_them(node: Path, tmp_path: Path) -> None:
    found = surveyed(
        refused(tmp_path, installed=False),
        paddle=driver(PluggedDevice(str(node))),
        other=driver(PluggedDevice(str(node))),
    )
    assert [each.state for each in found.rows] == ["rules not installed"] * 2
    (line,) = found.advice
    assert re.fullmatch(r"sudo \S*.*weberlink devices --install-rules", line)
    assert shown(found).splitlines()[-1] == f"other, paddle: {line}"


def test_rules_of_another_version_do_not_count(node: Path, tmp_path: Path) -> None:
    host = refused(tmp_path, installed=True)
    (tmp_path / UDEV_RULES).write_text(RULES.replace("0006", "0007"), encoding="utf-8")
    assert row(host, paddle=driver(PluggedDevice(str(node)))).state == "rules not installed"


def test_no_permission_with_the_rules_is_an_older_node(node: Path, tmp_path: Path) -> None:
    node.chmod(0o600)
    found = row(refused(tmp_path, installed=True), paddle=driver(PluggedDevice(str(node))))
    assert found.state == "no permission"
    assert found.advice == (f"unplug {node} and plug it in again: it has been there for longer than the rules",)


def foreign_group() -> grp.struct_group:
    """One that is not root's."""
    return next(group for group in grp.getgrall() if group.gr_gid != 0)


@pytest.mark.skipif(os.getuid() != 0, reason="gives a file to another group, which takes root")
def test_the_group_is_named_only_where_it_is_what_is_missing(node: Path, tmp_path: Path) -> None:
    group = foreign_group()
    os.chown(node, 0, group.gr_gid)
    plugged = driver(PluggedDevice(str(node)))

    def advice(mode: int, groups: frozenset[int] = frozenset()) -> str:
        node.chmod(mode)
        (line,) = row(refused(tmp_path, installed=True, groups=groups), paddle=plugged).advice
        return line

    assert advice(0o660).startswith(f"sudo usermod -aG {group.gr_name} $USER ")
    assert "usermod" not in advice(0o640)
    assert "usermod" not in advice(0o600)
    assert "usermod" not in advice(0o660, frozenset({group.gr_gid}))
    os.chown(node, 0, 0)
    assert "usermod" not in advice(0o660), "nobody joins root"


@pytest.mark.skipif(os.getuid() != 0, reason="gives a file to another group, which takes root")
def test_who_was_added_to_the_group_since_is_told_to_log_in_again(node: Path) -> None:
    group = next((each for each in grp.getgrall() if each.gr_mem and each.gr_gid != 0), None)
    if group is None:
        pytest.skip("no group here has members")
    os.chown(node, 0, group.gr_gid)
    node.chmod(0o660)
    assert rules.group_line(str(node), (), user=group.gr_mem[0]) == (
        f"log out and in again: you are in the group {group.gr_name}, but this session began before"
    )


def test_the_rules_are_not_blamed_for_the_device_of_another_package(
    node: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    source = (
        "from weberlink.hardware.discovery import PluggedDevice\nclass Odd:\n    @classmethod\n    def plugged(cls):\n"
        f"        return [PluggedDevice({str(node)!r})]\n"
    )
    install(tmp_path, "odd-device", {"odd_device": source}, "[weberlink.devices]\nodd_device = odd_device:Odd\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    node.chmod(0o600)
    (found,) = (each for each in survey(refused(tmp_path, installed=False)).rows if each.driver == "odd_device")
    assert found.state == "no permission"
    assert found.advice == (f"no permission to open {node}; odd-device says which udev rule it takes",)


@pytest.mark.parametrize(
    ("latency", "installed", "ends"), [(16, False, "--install-rules"), (16, True, "latency_timer")]
)
def test_a_slow_latency_timer_is_said_with_what_makes_it_fast(
    latency: int, installed: bool, ends: str, tmp_path: Path
) -> None:
    timer = tmp_path / "ttyUSB0" / "device" / "latency_timer"
    timer.parent.mkdir(parents=True)
    timer.write_text("16\n")
    (tmp_path / UDEV_RULES).write_text(RULES if installed else "", encoding="utf-8")
    host = Host(accessible=lambda path: True, rules=(tmp_path,), ttys=tmp_path)
    plugged = driver(PluggedDevice("/dev/ttyUSB0"), PluggedDevice("/dev/ttyACM0"))
    found = row(host, arm=plugged)
    assert found.state == "ready"
    assert found.advice[0].startswith("/dev/ttyUSB0 holds replies back for 16 ms (latency timer): ")
    assert found.advice[0].endswith(ends)
    timer.write_text("1\n")
    assert len(row(host, arm=plugged).advice) == 1


# --- how it is shown


def test_the_table_fits_80_columns_and_loses_nothing() -> None:
    found = surveyed(
        polhem_serial=driver(
            PluggedDevice("/dev/ttyACM0", "USB Serial", "12345670"),
            PluggedDevice(
                "/dev/ttyACM1", "A Very Talkative Haptic Device of Somebody", "ABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789"
            ),
            NEEDS=("json", "statistics"),
        ),
        a_name_that_is_longer_than_any_driver_has_had=driver(),
    )
    lines = shown(found).splitlines()
    table = [line for line in lines if not line.startswith("polhem_serial: ")]
    assert max(map(len, table)) <= 80
    text = "".join("".join(table).split())
    for part in ("/dev/ttyACM0", "(serialnumber12345670)", "ABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789)"):
        assert part in text.replace("ready", "")
    assert "nothing plugged in" in shown(found)


def test_what_helps_stays_on_one_line_however_long() -> None:
    found = surveyed(paddle=driver(PluggedDevice("/dev/" + "x" * 100, problem="press the button")))
    assert shown(found).splitlines()[-1] == f"paddle: /dev/{'x' * 100}: press the button"


def test_the_command_shows_it_and_is_content_with_nothing_plugged_in() -> None:
    shown_ = CliRunner().invoke(app, ["devices"])
    assert (shown_.exit_code, shown_.stderr) == (0, "")
    assert shown_.stdout.splitlines()[0].split() == ["side", "driver", "kind", "state", "plugged", "in"]
    document = json.loads(CliRunner().invoke(app, ["devices", "--json", "-"]).stdout)
    assert {each["driver"] for each in document["drivers"]} >= {*devices.BUILT_IN, *robots.BUILT_IN}


# --- the rules file


def test_the_rules_are_readable_by_udev() -> None:
    """Every line is a list of keys that udev knows, with operators that fit."""
    keys = (
        r"(?:ACTION|KERNEL|SUBSYSTEM|TEST|ATTRS?\{[\w/]+\})(?:==|!=)|"
        r"(?:ENV\{\w+\}|ATTR\{[\w/]+\}|GROUP|MODE|GOTO|LABEL)=|TAG\+="
    )
    rule = re.compile(rf'(?:{keys})"[^"]*"(?:, (?:{keys})"[^"]*")*')
    lines = [line for line in RULES.splitlines() if line and not line.startswith("#")]
    assert len(lines) >= 3
    for line in lines:
        assert rule.fullmatch(line), line
    assert re.findall(r'GOTO="(\w+)"', RULES) == re.findall(r'LABEL="(\w+)"', RULES)
    assert int(UDEV_RULES[:2]) < 73, "73-seat-late.rules reads the tag"


def hardware() -> dict[str, tuple[UsbId, ...]]:
    """USB identities of the built-in drivers that have any."""
    usb = {}
    for table in (devices, robots):
        for name in table.BUILT_IN:
            found = getattr(table.load(name), "USB", ())
            if found:
                usb[name] = found
    return usb


def granted(rules_: str, usb: UsbId) -> bool:
    """Whether a rule gives access to a device of this identity."""
    for line in rules_.splitlines():
        vendor, product = (re.search(rf'ATTRS\{{{key}\}}=="([^"]*)"', line) for key in ("idVendor", "idProduct"))
        if 'TAG+="uaccess"' not in line or vendor is None or vendor[1] != f"{usb.vendor:04x}":
            continue
        patterns = ["*"] if product is None else product[1].split("|")
        shown_product = "any" if usb.product is None else f"{usb.product:04x}"
        if any(pattern == "*" or fnmatchcase(shown_product, pattern) for pattern in patterns):
            return True
    return False


def test_the_rules_name_the_devices_of_every_built_in_driver() -> None:
    for name, identities in hardware().items():
        for usb in identities:
            assert granted(RULES, usb), f"{UDEV_RULES} gives no access to {usb} of {name}"


def test_a_device_that_no_rule_names_would_be_found() -> None:
    assert granted(RULES, UsbId(0x1234, 0x0006))
    assert not granted(RULES, UsbId(0x1234, 0x0007))
    assert not granted(RULES, UsbId(0xDEAD, None))
    assert not granted(RULES.replace('TAG+="uaccess"', ""), UsbId(0x1234, 0x0006))


def test_the_rules_are_part_of_the_package() -> None:
    project = tomllib.loads((CONFIGS.parent / "pyproject.toml").read_text(encoding="utf-8"))
    patterns = project["tool"]["setuptools"]["package-data"]["configs"]
    assert any(fnmatchcase(UDEV_RULES, pattern) for pattern in patterns)


def test_udev_itself_accepts_the_rules() -> None:
    udevadm = shutil.which("udevadm")
    if udevadm is None:
        pytest.skip("no udevadm here")
    if subprocess.run([udevadm, "verify", "--help"], capture_output=True, check=False).returncode != 0:
        pytest.skip("this udevadm cannot verify rules")
    path = str(CONFIGS / UDEV_RULES)
    done = subprocess.run(
        [udevadm, "verify", "--resolve-names=never", path], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr


# --- the page


def test_the_page_of_devices_lists_every_built_in_driver_and_its_links_lead_somewhere() -> None:
    page = CONFIGS.parent / "docs" / "devices" / "README.md"
    text = page.read_text(encoding="utf-8")
    rows = [line.split("|")[1] for line in text.splitlines() if line.startswith("| `")]
    listed = [name for row in rows for name in re.findall(r"`(\w+)`", row)]
    assert sorted(listed) == sorted([*devices.BUILT_IN, *robots.BUILT_IN])
    for link in re.findall(r"\]\(([^)]+)\)", text):
        assert (page.parent / link).is_file(), link


# --- installing them


def udevadm_at(folder: Path, status: int = 0) -> tuple[str, Path]:
    """A udevadm that writes down what it was told."""
    program, log = folder / "udevadm", folder / "log"
    program.write_text(f'#!/bin/sh\necho "$@" >> {log}\necho "not today" >&2\nexit {status}\n')
    program.chmod(0o755)
    return str(program), log


def test_installing_copies_the_rules_and_lets_udev_apply_them(tmp_path: Path) -> None:
    program, log = udevadm_at(tmp_path)
    folder = tmp_path / "etc" / "rules.d"
    assert not rules.installed([folder])
    assert rules.install(folder, program) == [f"{folder / UDEV_RULES}: installed, and applied to what is plugged in"]
    assert rules.installed([tmp_path / "none", folder])
    assert [path.name for path in folder.iterdir()] == [UDEV_RULES]
    assert stat.S_IMODE((folder / UDEV_RULES).stat().st_mode) == 0o644
    reload, trigger = log.read_text().splitlines()
    assert reload == "control --reload"
    assert trigger.startswith("trigger --action=change ")
    assert all(f"--subsystem-match={name}" in trigger for name in ("hidraw", "tty", "usb"))


def test_rules_that_udev_does_not_apply_are_installed_all_the_same(tmp_path: Path) -> None:
    program, _ = udevadm_at(tmp_path, status=1)
    (line,) = rules.install(tmp_path, program)
    assert line == (
        f"{tmp_path / UDEV_RULES}: installed; udevadm control refused (not today), "
        "so unplug the devices and plug them in again, or restart"
    )
    (line,) = rules.install(tmp_path, str(tmp_path / "none"))
    assert "cannot be run" in line
    assert rules.installed([tmp_path])


def test_a_place_where_nothing_can_be_written_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(RulesError, match=r"cannot be written: Not a directory") as caught:
        rules.install(tmp_path / "file" / "rules.d", "true")
    assert "\n" not in str(caught.value)


def test_without_root_the_line_that_has_it_is_said(tmp_path: Path) -> None:
    """As another user, where the test has the right to become one."""
    folder = tmp_path / "rules.d"
    folder.mkdir(mode=0o555)
    is_root = os.geteuid() == 0
    if is_root:
        os.seteuid(65534)
    try:
        with pytest.raises(RulesError) as caught:
            rules.install(folder, "true")
    finally:
        if is_root:
            os.seteuid(0)
    line = rf"{folder}: only root may write there; run: sudo .*weberlink devices --install-rules"
    assert re.fullmatch(line, str(caught.value))
    assert list(folder.iterdir()) == []
