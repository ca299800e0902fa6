"""`weberlink device list`: drivers, plugged devices, suggested fixes, and the udev rules."""

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

from tests.apps.packages import add_drivers
from tests.system.packages import install
from tests.system.systems import CONFIGS
from weberlink.apps import rules
from weberlink.apps.devices import DeviceAccess, DriverStatus, Survey, survey
from weberlink.apps.rules import RulesError
from weberlink.cli import app
from weberlink.hardware.discovery import UDEV_RULES, PluggedDevice, UsbId
from weberlink.installation import install_line
from weberlink.master import devices
from weberlink.master.devices import leaders
from weberlink.registry import Registry
from weberlink.slave import robots
from weberlink.slave.robots import followers

RULES = (CONFIGS / UDEV_RULES).read_text(encoding="utf-8")
PORT = PluggedDevice("/dev/ttyACM0", "Paddle", "17")


def driver(*found: PluggedDevice, **attributes: Any) -> Any:
    """A hardware driver with these devices plugged in."""
    return type("Driver", (), {"USB": (), "plugged": classmethod(lambda cls: list(found)), **attributes})


def surveyed(access: DeviceAccess | None = None, **drivers: Any) -> Survey:
    """A survey of a master's drivers, on a host without rules where everything may be opened by default."""
    here = access or DeviceAccess(accessible=lambda path: True, rules=())
    return survey(here, {"master": [Registry("device", drivers)]})


def status(access: DeviceAccess | None = None, **drivers: Any) -> DriverStatus:
    (only,) = surveyed(access, **drivers).drivers
    return only


def shown(found: Survey) -> list[str]:
    """Lines on a terminal of 80 columns."""
    stream = io.StringIO()
    found.show(Console(file=stream, width=80))
    return stream.getvalue().splitlines()


def test_all_drivers_are_listed_and_virtual_ones_ready() -> None:
    found = {(each.side, each.driver): each for each in survey().drivers}
    assert {name for side, name in found if side == "master"} == {*devices.drivers(), *leaders.drivers()}
    assert {name for side, name in found if side == "slave"} == {*robots.drivers(), *followers.drivers()}
    for virtual in (("master", "operator"), ("master", "replay"), ("slave", "point"), ("slave", "simulated")):
        assert (found[virtual].kind, found[virtual].state) == ("virtual", "ready")


def test_document_is_json_with_the_content_of_the_table() -> None:
    found = surveyed(paddle=driver(PORT), broken="weberlink.missing:Driver")
    why = "cannot be loaded: ModuleNotFoundError: No module named 'weberlink.missing'"
    common = {"side": "master", "package": None, "extra": None}
    port = {"path": "/dev/ttyACM0", "name": "Paddle", "serial_number": "17", "problem": None}
    assert json.loads(json.dumps(found.document)) == {
        "drivers": [
            {**common, "driver": "broken", "kind": None, "state": "broken", "plugged": [], "advice": [why]},
            {**common, "driver": "paddle", "kind": "hardware", "state": "ready", "plugged": [port], "advice": []},
        ],
        "rules_installed": False,
        "advice": [{"line": why, "drivers": ["broken"]}],
    }
    assert "/dev/ttyACM0 Paddle" in "\n".join(shown(found))


def test_drivers_of_other_packages_name_their_package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    install(
        tmp_path,
        "others-things",
        {"others_things_good": "class Good: pass", "others_things_bad": "import others_things_missing"},
        "[weberlink.devices]\nothers_good = others_things_good:Good\nothers_bad = others_things_bad:Bad\n"
        "operator = others_things_bad:Bad\n"
        "[weberlink.robots]\nothers_none = others_things_good:None_\nothers_odd = others_things_good\n",
    )
    add_drivers(tmp_path, monkeypatch)
    found = survey()
    others = {each.driver: each for each in found.drivers if each.driver.startswith("others")}
    assert {each.package for each in others.values()} == {"others-things"}
    assert {name: each.state for name, each in others.items()} == {
        "others_good": "cannot be listed", "others_bad": "broken", "others_none": "broken", "others_odd": "broken",
    }  # fmt: skip
    assert others["others_bad"].advice == (
        "device others_bad of others-things: others_things_bad:Bad cannot be imported: "
        "ModuleNotFoundError: No module named 'others_things_missing'",
    )
    assert all(each.package is None for each in found.drivers if not each.driver.startswith("others"))


def fails(cls: Any) -> list[PluggedDevice]:
    raise OSError("no\nbus")


@pytest.mark.parametrize(
    ("candidate", "state", "advice"),
    [
        (type("Driver", (), {"NEEDS": ("no_such_package", "x")}), "extra missing", (install_line("x"),)),
        (type("Driver", (), {"NEEDS": ("json", "x"), "COMPUTED": True}), "ready", ()),
        (type("Driver", (), {"NEEDS": ("json", "x")}), "cannot be listed", ()),
        (driver(), "nothing plugged in", ()),
        (driver(plugged=classmethod(lambda cls: None)), "cannot be listed", ()),
        (driver(plugged=classmethod(fails)), "broken", ("plugged devices cannot be listed: OSError: no bus",)),
        (driver(PluggedDevice("/dev/p", problem="in boot mode")), "not usable", ("/dev/p: in boot mode",)),
    ],
)
def test_state_comes_with_its_fix(candidate: Any, state: str, advice: tuple[str, ...]) -> None:
    found = surveyed(paddle=candidate, other=driver())
    states = {each.driver: each for each in found.drivers}
    assert (states["paddle"].state, states["paddle"].advice) == (state, advice)
    assert states["other"].state == "nothing plugged in"


def test_identical_devices_are_listed_by_stable_names(tmp_path: Path) -> None:
    first, second = tmp_path / "ttyACM0", tmp_path / "ttyACM1"
    links = tmp_path / "by-id"
    links.mkdir()
    first.touch()
    second.touch()
    (links / "usb-Paddle_17").symlink_to(second)
    access = DeviceAccess(accessible=lambda path: True, rules=(), links=links)
    found = status(access, paddle=driver(PluggedDevice(str(first)), PluggedDevice(str(second))))
    assert found.state == "ready"
    assert found.advice == (
        f"2 are plugged in; say which under master.device: port: {first} or port: {links / 'usb-Paddle_17'}",
    )


def test_devices_without_port_are_chosen_by_their_option() -> None:
    access = DeviceAccess(accessible=lambda path: True, rules=())
    two = (PluggedDevice("/dev/bus/usb/001/004"), PluggedDevice("/dev/bus/usb/001/005"))
    found = status(access, paddle=driver(*two, CHOSEN_BY="serial_number"))
    assert found.advice == ("2 are plugged in; say which under master.device: serial_number",)


@pytest.fixture
def node(tmp_path: Path) -> Path:
    path = tmp_path / "ttyACM0"
    path.touch(0o600)
    return path


def refused(folder: Path, text: str | None = RULES, groups: frozenset[int] = frozenset()) -> DeviceAccess:
    """A host on which this user may open nothing, with these rules installed."""
    if text is not None:
        (folder / UDEV_RULES).write_text(text, encoding="utf-8")
    return DeviceAccess(accessible=lambda path: False, rules=(folder,), groups=groups)


@pytest.mark.parametrize("text", [None, RULES.replace("0006", "0007")], ids=["no rules", "rules of another version"])
def test_missing_rules_come_with_the_install_line(text: str | None, node: Path, tmp_path: Path) -> None:
    port = driver(PluggedDevice(str(node)))
    found = surveyed(refused(tmp_path, text), paddle=port, other=port)
    assert [each.state for each in found.drivers] == ["rules not installed"] * 2
    (line,) = found.advice
    assert re.fullmatch(r"sudo \S*.*weberlink device rules", line)
    assert shown(found)[-1] == f"other, paddle: {line}"


def test_no_permission_despite_the_rules_means_replugging(node: Path, tmp_path: Path) -> None:
    found = status(refused(tmp_path), paddle=driver(PluggedDevice(str(node))))
    assert found.state == "no permission"
    assert found.advice == (f"unplug {node} and plug it in again: it was plugged in before the rules were installed",)


@pytest.mark.skipif(os.getuid() != 0, reason="gives a file to another group, which takes root")
def test_missing_group_is_named_only_if_it_helps(node: Path, tmp_path: Path) -> None:
    group = next(group for group in grp.getgrall() if group.gr_gid != 0)
    os.chown(node, 0, group.gr_gid)

    def advice(mode: int, groups: frozenset[int] = frozenset()) -> str:
        node.chmod(mode)
        (line,) = status(refused(tmp_path, groups=groups), paddle=driver(PluggedDevice(str(node)))).advice
        return line

    assert advice(0o660).startswith(f"sudo usermod -aG {group.gr_name} $USER ")
    for mode, groups in ((0o640, ()), (0o600, ()), (0o660, (group.gr_gid,))):
        assert "usermod" not in advice(mode, frozenset(groups))
    os.chown(node, 0, 0)
    assert "usermod" not in advice(0o660), "nobody joins root"


@pytest.mark.skipif(os.getuid() != 0, reason="gives a file to another group, which takes root")
def test_new_member_of_the_group_must_log_in_again(node: Path) -> None:
    group = next((each for each in grp.getgrall() if each.gr_mem and each.gr_gid != 0), None)
    if group is None:
        pytest.skip("no group here has members")
    os.chown(node, 0, group.gr_gid)
    node.chmod(0o660)
    assert rules.group_line(str(node), (), user=group.gr_mem[0]) == (
        f"log out and in again: you are in the group {group.gr_name}, but this login began before that"
    )


def test_rules_are_not_advised_for_other_packages(node: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    source = (
        "from weberlink.hardware.discovery import PluggedDevice\nclass Odd:\n    @classmethod\n    def plugged(cls):\n"
        f"        return [PluggedDevice({str(node)!r})]\n"
    )
    install(tmp_path, "odd-device", {"odd_device": source}, "[weberlink.devices]\nodd_device = odd_device:Odd\n")
    add_drivers(tmp_path, monkeypatch)
    (found,) = (each for each in survey(refused(tmp_path, None)).drivers if each.driver == "odd_device")
    assert found.state == "no permission"
    assert found.advice == (f"no permission to open {node}; odd-device documents the udev rule that it needs",)


@pytest.mark.parametrize(("text", "end"), [("", "device rules"), (RULES, "latency_timer")])
def test_slow_latency_timer_comes_with_a_fix(text: str, end: str, tmp_path: Path) -> None:
    timer = tmp_path / "ttyUSB0" / "device" / "latency_timer"
    timer.parent.mkdir(parents=True)
    timer.write_text("16\n")
    (tmp_path / UDEV_RULES).write_text(text, encoding="utf-8")
    access = DeviceAccess(accessible=lambda path: True, rules=(tmp_path,), ttys=tmp_path)
    plugged = driver(PluggedDevice("/dev/ttyUSB0"), PluggedDevice("/dev/ttyACM0"))
    found = status(access, arm=plugged)
    assert found.state == "ready"
    assert found.advice[0].startswith("/dev/ttyUSB0 delays replies by 16 ms (latency timer): ")
    assert found.advice[0].endswith(end)
    timer.write_text("1\n")
    assert len(status(access, arm=plugged).advice) == 1


def test_table_fits_80_columns_and_fixes_are_unbroken() -> None:
    found = surveyed(
        polhem_serial=driver(
            PluggedDevice("/dev/ttyACM0", "USB Serial", "12345670"),
            PluggedDevice(
                "/dev/ttyACM1", "A Very Talkative Haptic Device of Somebody", "ABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789"
            ),
            NEEDS=("json", "statistics"),
        ),
        a_name_that_is_longer_than_any_driver_has_had=driver(),
        paddle=driver(PluggedDevice("/dev/" + "x" * 100, problem="press the button")),
    )
    lines = shown(found)
    table = lines[: -len(found.advice)]
    assert max(map(len, table)) <= 80
    text = "".join("".join(table).split()).replace("ready", "")
    for part in ("/dev/ttyACM0", "(serialnumber12345670)", "ABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789)"):
        assert part in text
    assert f"paddle: /dev/{'x' * 100}: press the button" in lines


def test_command_succeeds_with_nothing_plugged_in() -> None:
    ended = CliRunner().invoke(app, ["device", "list"])
    assert (ended.exit_code, ended.stderr) == (0, "")
    assert ended.stdout.splitlines()[0].split() == ["side", "driver", "kind", "state", "plugged", "in"]
    document = json.loads(CliRunner().invoke(app, ["device", "list", "--json", "-"]).stdout)
    assert {each["driver"] for each in document["drivers"]} >= {*devices.BUILT_IN, *robots.BUILT_IN}


def test_rules_use_keys_that_udev_knows() -> None:
    """Every line is a list of keys that udev knows, with operators that fit."""
    keys = (
        r"(?:ACTION|KERNEL|SUBSYSTEM|TEST|ENV\{\w+\}|ATTRS?\{[\w/]+\})(?:==|!=)|"
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


def test_rules_cover_every_built_in_driver() -> None:
    for name, identities in hardware().items():
        for usb in identities:
            assert granted(RULES, usb), f"{UDEV_RULES} gives no access to {usb} of {name}"
    assert not granted(RULES, UsbId(0x1234, 0x0007))
    assert not granted(RULES, UsbId(0xDEAD, None))
    assert not granted(RULES.replace('TAG+="uaccess"', ""), UsbId(0x1234, 0x0006))


def test_rules_are_part_of_the_package() -> None:
    project = tomllib.loads((CONFIGS.parent / "pyproject.toml").read_text(encoding="utf-8"))
    patterns = project["tool"]["setuptools"]["package-data"]["weberlink.configs"]
    assert any(fnmatchcase(UDEV_RULES, pattern) for pattern in patterns)


def test_udevadm_accepts_the_rules() -> None:
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


def test_device_page_lists_every_driver_with_valid_links() -> None:
    page = CONFIGS.parent / "docs" / "devices" / "README.md"
    text = page.read_text(encoding="utf-8")
    rows = [line.split("|")[1] for line in text.splitlines() if line.startswith("| `")]
    listed = [name for row in rows for name in re.findall(r"`(\w+)`", row)]
    assert sorted(listed) == sorted([*devices.BUILT_IN, *robots.BUILT_IN])
    for link in re.findall(r"\]\(([^)]+)\)", text):
        assert (page.parent / link).is_file(), link


def udevadm_at(folder: Path, status: int = 0) -> tuple[str, Path]:
    """A udevadm that writes down what it was told."""
    program, log = folder / "udevadm", folder / "log"
    program.write_text(f'#!/bin/sh\necho "$@" >> {log}\necho "not today" >&2\nexit {status}\n')
    program.chmod(0o755)
    return str(program), log


def test_install_copies_and_applies_the_rules(tmp_path: Path) -> None:
    program, log = udevadm_at(tmp_path)
    folder = tmp_path / "etc" / "rules.d"
    assert not rules.installed([folder])
    assert rules.install(folder, program) == [f"{folder / UDEV_RULES}: installed, and applied to plugged devices"]
    assert rules.installed([tmp_path / "none", folder])
    assert [path.name for path in folder.iterdir()] == [UDEV_RULES]
    assert stat.S_IMODE((folder / UDEV_RULES).stat().st_mode) == 0o644
    reload, trigger = log.read_text().splitlines()
    assert reload == "control --reload"
    assert trigger.startswith("trigger --action=change ")
    assert all(f"--subsystem-match={name}" in trigger for name in ("hidraw", "tty", "usb"))


def test_rules_are_installed_even_if_udev_fails(tmp_path: Path) -> None:
    program, _ = udevadm_at(tmp_path, status=1)
    (line,) = rules.install(tmp_path, program)
    assert line == (
        f"{tmp_path / UDEV_RULES}: installed; udevadm control refused (not today), "
        "so unplug the devices and plug them in again, or restart"
    )
    (line,) = rules.install(tmp_path, str(tmp_path / "none"))
    assert "cannot be run" in line
    assert rules.installed([tmp_path])


def test_unwritable_folder_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(RulesError, match=r"cannot be written: Not a directory") as caught:
        rules.install(tmp_path / "file" / "rules.d", "true")
    assert "\n" not in str(caught.value)


def test_install_without_root_gives_the_sudo_line(tmp_path: Path) -> None:
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
    line = rf"{folder}: only root may write there; run: sudo .*weberlink device rules"
    assert re.fullmatch(line, str(caught.value))
    assert list(folder.iterdir()) == []
