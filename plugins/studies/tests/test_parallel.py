"""Worker processes end with the program that started them."""

import os
import signal
import subprocess
import sys
from pathlib import Path

from tests.program import ROOT
from tests.wait import until

ASKS = """
import sys
from weberlink_studies.parallel import parallel_map
from plugins.studies.tests.test_parallel import note_and_wait
if __name__ == "__main__":
    parallel_map(note_and_wait, [(sys.argv[1], 0), (sys.argv[1], 1)], 2)
"""


def note_and_wait(task: tuple[str, int]) -> None:
    """Note the process of a task; the second task never ends."""
    folder, number = task
    (Path(folder) / f"{number}.{os.getpid()}").touch()
    if number:
        signal.pause()


def test_no_worker_outlives_a_killed_program(tmp_path: Path) -> None:
    script = tmp_path / "asks.py"
    script.write_text(ASKS, encoding="utf-8")
    folder = tmp_path / "workers"
    folder.mkdir()
    program = subprocess.Popen(
        [sys.executable, str(script), str(folder)],
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        stderr=subprocess.DEVNULL,  # where what tidies up after the dead says so
    )
    try:
        until(lambda: len(list(folder.iterdir())) == 2, "both tasks to begin")
        workers = {int(path.suffix[1:]) for path in folder.iterdir()}
    finally:
        program.kill()
        program.wait()
    try:
        until(lambda: not any(map(is_running, workers)), "the workers to end")
    finally:
        for pid in filter(is_running, workers):
            os.kill(pid, signal.SIGKILL)


def is_running(pid: int) -> bool:
    """Whether a process is there and more than its exit status is left."""
    try:
        status = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8")
    except (FileNotFoundError, ProcessLookupError):
        return False
    return status.rpartition(")")[2].split()[0] not in ("Z", "X")
