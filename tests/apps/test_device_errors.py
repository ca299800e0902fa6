"""Every problem with a device is one line of the program that says what to do.

Hardware is emulated: serial ports are pseudo terminals, HID devices those of umockdev, which hides the real ones.
"""

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

import pytest

from tests.system.systems import CONFIGS
from weberlink.hardware.emulator import PtyDevice
from weberlink.hardware.umockdev import HidNode, Testbed, missing
from weberlink.installation import install_line
from weberlink.master.emulators import load
from weberlink.protocol.keys import generate

DEVICE = """
link: {{listen: "127.0.0.1:0", slave: "127.0.0.1:9", security: psk, key_file: KEY}}
codec: {{position: {{step_m: 0.00001}}}}
master: {{device: {device}}}
"""
PROGRAM = "import sys; sys.modules.update(dict.fromkeys({hidden!r})); from weberlink.cli import main; main()"
NO_OVERRIDE = "-dac_override,-dac_read_search"


@dataclass(frozen=True)
class Trouble:
    """A command that fails because of a device.

    Args:
        arguments: of the program.
        status: that it ends with.
        says: in the one line.
        prefix: a command that runs it.
        hidden: packages that count as not installed.
        environment: variables that it gets.
    """

    arguments: Sequence[object]
    status: int
    says: Sequence[str]
    prefix: Sequence[str] = ()
    hidden: Sequence[str] = ()
    environment: dict[str, str] = field(default_factory=lambda: dict(os.environ))


@contextmanager
def missing_extra(folder: Path) -> Iterator[Trouble]:
    says = ["slave.robot", install_line("mujoco")]
    yield Trouble(["check", CONFIGS / "mujoco-arm.yaml"], 2, says, hidden=["mujoco"])


@contextmanager
def no_permission(folder: Path) -> Iterator[Trouble]:
    prefix: list[str] = []
    if os.geteuid() == 0:  # whom no permission stops
        if shutil.which("setpriv") is None:
            pytest.skip("no setpriv here, to take from root what only root may")
        prefix = ["setpriv", f"--bounding-set={NO_OVERRIDE}", f"--inh-caps={NO_OVERRIDE}"]
    node = folder / "port"
    node.touch(mode=0o000)
    file = written(folder, f"{{driver: polhem_serial, port: {node}}}")
    says = [str(node), "no permission", "weberlink device rules"]
    yield Trouble(["master", file, "--duration", 1], 1, says, prefix=prefix)


@contextmanager
def nothing_plugged_in(folder: Path) -> Iterator[Trouble]:
    with hid_bed() as bed:
        file = written(folder, "{driver: polhem_serial}")
        says = ["polhem_serial", "nothing of the kind is plugged in", "`weberlink device list`"]
        yield Trouble(["master", file, "--duration", 1], 1, says, environment=bed.environment)


@contextmanager
def two_alike(folder: Path) -> Iterator[Trouble]:
    with hid_bed() as bed, two_hid_devices(bed) as (first, second):
        file = written(folder, "{driver: polhem_hid}")
        says = ["polhem_hid", "2 are plugged in", first, second, f"master.device.port: {first}"]
        yield Trouble(["master", file, "--duration", 1], 1, says, environment=bed.environment)


@contextmanager
def the_wrong_model(folder: Path) -> Iterator[Trouble]:
    emulator = load("polhem_serial")
    with PtyDevice(emulator(emulator.Options(model="woodenhaptics")), folder / "port") as wire:
        file = written(folder, f"{{driver: polhem_serial, model: vintage_phantom, port: {wire.path}}}")
        says = [str(wire.path), "woodenhaptics", "vintage_phantom", "set master.device.model: woodenhaptics"]
        yield Trouble(["master", file, "--duration", 1], 1, says)


@contextmanager
def hid_bed() -> Iterator[Testbed]:
    reason = missing()
    if reason is not None:
        pytest.skip(reason)
    with Testbed() as bed:
        yield bed


@contextmanager
def two_hid_devices(bed: Testbed) -> Iterator[list[str]]:
    """The paths of two alike."""
    with ExitStack() as stack:
        emulators = [load("polhem_hid")(load("polhem_hid").Options()) for _ in range(2)]
        yield [stack.enter_context(HidNode(bed, each, each.identity)).node for each in emulators]


def written(folder: Path, device: str) -> Path:
    file = folder / "system.yaml"
    generate(folder / "KEY")
    file.write_text(DEVICE.format(device=device), encoding="utf-8")
    return file


def ended(trouble: Trouble) -> subprocess.CompletedProcess[str]:
    program = PROGRAM.format(hidden=list(trouble.hidden))
    return subprocess.run(
        [*trouble.prefix, sys.executable, "-c", program, *map(str, trouble.arguments)],
        cwd=CONFIGS.parent, env=trouble.environment, capture_output=True, text=True, timeout=60, check=False,
    )  # fmt: skip


@pytest.mark.parametrize(
    "trouble",
    [missing_extra, no_permission, nothing_plugged_in, two_alike, the_wrong_model],
    ids=lambda it: it.__name__,
)
def test_device_problem_is_one_line_with_the_fix(
    trouble: Callable[[Path], AbstractContextManager[Trouble]], tmp_path: Path
) -> None:
    with trouble(tmp_path) as met:
        result = ended(met)
    assert result.returncode == met.status, result.stderr
    lines = [line for line in result.stderr.splitlines() if not line.startswith("weberlink: note: ")]
    assert len(lines) == 1, result.stderr
    assert lines[0].startswith("weberlink")
    for part in met.says:
        assert part in lines[0]
    words = lines[0].split(": ")
    assert all(a != b for a, b in pairwise(words)), "says nothing twice"


def test_identical_hid_devices_are_listed_with_their_ports() -> None:
    with hid_bed() as bed, two_hid_devices(bed) as (first, second):
        listing = subprocess.run(
            [sys.executable, "-m", "weberlink", "device", "list", "--json", "-"],
            cwd=CONFIGS.parent, env=bed.environment, capture_output=True, text=True, timeout=60, check=True,
        )  # fmt: skip
    (row,) = (each for each in json.loads(listing.stdout)["drivers"] if each["driver"] == "polhem_hid")
    assert [each["path"] for each in row["plugged"]] == [first, second]
    assert row["state"] == "ready"
    assert row["advice"] == [f"2 are plugged in; say which under master.device: port: {first} or port: {second}"]
