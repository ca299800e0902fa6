"""Children of every kind are started in a folder of hostile modules: they do their work, and import none of them."""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import chdir
from pathlib import Path
from typing import Any

import pytest

from tests.program import PATIENT, ROOT
from tests.session.systems import CONFIGS
from weberlink.child_process import Child, python, shared_memory
from weberlink.session.description import DaemonOrder
from weberlink.testing.time import running_time

SESSION = (str(CONFIGS / "loopback.yaml"), "--duration", "1", "--set", "realtime.lock_memory=false", *PATIENT)
OTHERS = ("weberlink", "aioice", "cv2", "msgpack", "mujoco", "numpy", "pydantic", "twisted", "uvloop", "websockets")
HOSTILE = "with open({marker!r}, 'a') as marker:\n    marker.write(__name__ + ' ')\n"
RUN = {
    "rules.py": ".with_name",
    "child_process.py": '[sys.executable, "-',  # -P or -I
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


def child(code: str, *arguments: str, **options: Any) -> Child:
    return Child(python("-c", code, *arguments), **options)


def test_a_child_reads_lines_and_its_lines_are_read_whole() -> None:
    echo = child(
        "import sys\nfor line in sys.stdin: sys.stdout.write(line[::-1] + '.'); sys.stdout.flush()", stdin=-1, stdout=-1
    )
    echo.write_line("abc")
    lines = echo.lines(10.0)
    assert lines == [b""], "the line of which the end has not come is kept"
    assert echo.end(10.0) == b"cba."
    assert (echo.status, echo.how_it_ended, echo.lines()) == (0, "ended with status 0", [])
    assert echo.end(10.0) == b"cba."
    echo.write_line("nobody reads this")


STUBBORN = """
import signal, sys, time
signal.signal(signal.SIGTERM, signal.SIG_IGN if sys.argv[1:] else lambda *_: sys.exit())
sys.stdout.write("ready\\n")
sys.stdout.flush()
time.sleep(60)
"""


@pytest.mark.parametrize(
    ("ignored", "limit", "status"), [((), 1.0, 0), ((signal.SIGTERM,), 0.1, -signal.SIGKILL)], ids=["heeds", "ignores"]
)
def test_a_child_ends_in_bounded_time(ignored: tuple[signal.Signals, ...], limit: float, status: int) -> None:
    process = child(STUBBORN, *map(str, ignored), stdout=-1)
    assert process.lines(10.0) == [b"ready"]
    with running_time() as ran:
        process.end(limit, signal.SIGTERM)
    assert ran() < 5.0
    assert process.status == status
    assert ("SIGKILL" in process.how_it_ended) == bool(ignored)


def test_signals_wait_until_the_child_takes_them() -> None:
    ours = signal.pthread_sigmask(signal.SIG_BLOCK, ())
    code = "import signal\nprint(*sorted(signal.pthread_sigmask(signal.SIG_BLOCK, ())), flush=True)"
    process = child(code, stdout=-1, blocked=(signal.SIGINT,))
    assert str(int(signal.SIGINT)).encode() in process.end(10.0).split()
    assert signal.pthread_sigmask(signal.SIG_BLOCK, ()) == ours


def test_an_order_arrives_as_it_was_given() -> None:
    order = DaemonOrder("slave", "a.yaml", ("rate_hz=500", 'link.listen="x"'), "/a ring", 1.5)
    assert order.parent == os.getpid()
    assert DaemonOrder.from_json(order.to_json()) == order


def test_memory_is_shared() -> None:
    with shared_memory("weberlink-test", 4) as (memory, descriptor):
        code = f"from mmap import mmap\nmmap({descriptor}, 4)[:] = b'here'"
        child(code, pass_fds=(descriptor,)).end(10.0)
    assert memory[:] == b"here"
