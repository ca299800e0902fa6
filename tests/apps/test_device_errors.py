"""Every problem with a device is one line of the program that says what to do.

Hardware is emulated: serial ports are pseudo terminals.
"""

import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import pytest

from tests.wait import PATIENCE
from weberlink.hardware.emulator import PtyDevice
from weberlink.master.emulators import load
from weberlink.protocol.keys import generate

DEVICE = """
link: {{listen: "127.0.0.1:0", slave: "127.0.0.1:9", security: psk, key_file: KEY}}
codec: {{position: {{step_m: 0.00001}}}}
master: {{device: {device}}}
"""
PROGRAM = (sys.executable, "-m", "weberlink")
NO_OVERRIDE = "-dac_override,-dac_read_search"


class Trouble(NamedTuple):
    """A device that a master cannot use: its options, the parts of the one line, and how the program runs."""

    device: str
    parts: tuple[str, ...]
    prefix: tuple[str, ...] = ()


@contextmanager
def no_permission(folder: Path) -> Iterator[Trouble]:
    prefix: tuple[str, ...] = ()
    if os.geteuid() == 0:  # whom no permission stops
        if shutil.which("setpriv") is None:
            pytest.skip("no setpriv here, to take from root what only root may")
        prefix = ("setpriv", f"--bounding-set={NO_OVERRIDE}", f"--inh-caps={NO_OVERRIDE}")
    node = folder / "port"
    node.touch(mode=0o000)
    yield Trouble(f"{{driver: polhem_serial, port: {node}}}", (str(node), "weberlink device rules"), prefix)


@contextmanager
def the_wrong_model(folder: Path) -> Iterator[Trouble]:
    emulator = load("polhem_serial")
    with PtyDevice(emulator(emulator.Options(model="woodenhaptics")), folder / "port") as wire:
        parts = (str(wire.path), "vintage_phantom", "master.device.model: woodenhaptics")
        yield Trouble(f"{{driver: polhem_serial, model: vintage_phantom, port: {wire.path}}}", parts)


@pytest.mark.parametrize("trouble", [no_permission, the_wrong_model])
def test_device_problem_is_one_line_with_the_fix(
    trouble: Callable[[Path], AbstractContextManager[Trouble]], tmp_path: Path
) -> None:
    file = tmp_path / "system.yaml"
    generate(tmp_path / "KEY")
    with trouble(tmp_path) as met:
        file.write_text(DEVICE.format(device=met.device), encoding="utf-8")
        command = [*met.prefix, *PROGRAM, "master", str(file), "--duration", "1"]
        result = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE, check=False)
    (line,) = (line for line in result.stderr.splitlines() if not line.startswith("weberlink: note: "))
    assert (result.returncode, line.startswith("weberlink")) == (1, True)
    assert [part for part in met.parts if part not in line] == []
    assert all(a != b for a, b in pairwise(line.split(": "))), "says nothing twice"
