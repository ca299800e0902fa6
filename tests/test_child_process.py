"""Children of every kind are started in a folder of hostile modules: they do their work, and import none of them."""

import json
import subprocess
import sys
from collections.abc import Iterator
from contextlib import chdir
from pathlib import Path
from socket import socket

import pytest

from tests.program import PATIENT, ROOT
from tests.system.systems import CONFIGS
from weberlink.anywhere.order import FinderOrder, start_finder
from weberlink.anywhere.pairing_order import PairingOrder, start_pairing
from weberlink.child_process import python
from weberlink.hardware.fault import HardwareFault
from weberlink.master.devices.touch.process import ServoProcess
from weberlink.master.devices.touch.servo import ServoArguments
from weberlink.protocol.aio import hand_over
from weberlink.protocol.aio.hand_over import PathNews

NOWHERE = "ws://127.0.0.1:1/v1"
SESSION = (str(CONFIGS / "loopback.yaml"), "--duration", "1", "--set", "realtime.lock_memory=false", *PATIENT)
OTHERS = ("weberlink", "aioice", "cv2", "msgpack", "mujoco", "numpy", "pydantic", "twisted", "uvloop", "websockets")
HOSTILE = "with open({marker!r}, 'a') as marker:\n    marker.write(__name__ + ' ')\n"
RUN = {
    "guardian.py": "-I",
    "rules.py": ".with_name",
    "child_process.py": "-P",
    "installation.py": "Path(sys.executable)",  # only names what the user may run
}
"""Files of the product that name the interpreter, and how each keeps to installed modules."""


@pytest.fixture
def executed(tmp_path: Path) -> Iterator[Path]:
    """The working directory has a module of every name that a child imports; the file tells which were executed."""
    folder, marker = tmp_path / "hostile", tmp_path / "executed"
    folder.mkdir()
    for name in {*sys.stdlib_module_names, *OTHERS}:
        (folder / f"{name}.py").write_text(HOSTILE.format(marker=str(marker)))
    with chdir(folder):
        yield marker
    assert not marker.exists(), marker.read_text()


@pytest.mark.usefixtures("executed")
def test_python_path_counts(tmp_path: Path) -> None:
    (tmp_path / "own.py").write_text("print('own')")
    command = python("-m", "own")
    done = subprocess.run(command, env={"PYTHONPATH": str(tmp_path)}, capture_output=True, text=True, check=True)
    assert done.stdout == "own\n"


@pytest.mark.usefixtures("executed")
def test_finder_imports_nothing_from_the_working_directory(tmp_path: Path) -> None:
    process, end = start_finder(FinderOrder("master", ("nobody",), str(tmp_path), NOWHERE))
    with process, end:
        assert "nobody" in first_news(end).text


def first_news(end: socket) -> PathNews:
    end.setblocking(True)
    received = hand_over.receive(end)
    assert received is not None and isinstance(received[0], PathNews)
    return received[0]


@pytest.mark.usefixtures("executed")
def test_pairing_imports_nothing_from_the_working_directory(tmp_path: Path) -> None:
    pytest.importorskip("wormhole")
    with start_pairing(PairingOrder("slave", "robot", str(tmp_path), NOWHERE)) as process:
        assert process.stdout is not None
        assert NOWHERE in json.loads(process.stdout.readline())["refused"]


@pytest.mark.usefixtures("executed")
def test_servo_imports_nothing_from_the_working_directory() -> None:
    arguments = ServoArguments("libnowhere.so", None, force=False, stale_s=0.01, ramp_s=0.1, calibration_s=1.0)
    process = ServoProcess(arguments)
    with pytest.raises(HardwareFault, match=r"libnowhere\.so"):
        process.start()


@pytest.mark.realtime
@pytest.mark.usefixtures("executed")
def test_session_imports_nothing_from_the_working_directory() -> None:
    """Both daemons, and the watcher of the host."""
    command = python("-m", "weberlink", "loopback", *SESSION, "--json", "-")
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert (done.stderr, json.loads(done.stdout)["outcome"]) == ("", "completed")


def test_only_one_place_makes_commands_of_the_interpreter() -> None:
    # Some are links, which rglob does not follow.
    product = [*ROOT.glob("plugins/*/src"), *(ROOT / "src" / "weberlink").iterdir()]
    files = [path for part in product for path in ([part] if part.is_file() else part.rglob("*.py"))]
    found = {path.name: path for path in files if path.suffix == ".py" and "sys.executable" in path.read_text()}
    assert found.keys() == RUN.keys()
    for name, how in RUN.items():
        lines = [line for line in found[name].read_text().splitlines() if "sys.executable" in line]
        assert lines and all(how in line for line in lines)
