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
    script, folder = tmp_path / "asks.py", tmp_path / "workers"
    script.write_text(ASKS, encoding="utf-8")
    folder.mkdir()
    command = [sys.executable, str(script), str(folder)]
    # What tidies up after the dead says so.
    program = subprocess.Popen(command, env=os.environ | {"PYTHONPATH": str(ROOT)}, stderr=subprocess.DEVNULL)
    try:
        until(lambda: len(list(folder.iterdir())) == 2, "both tasks to begin")
    finally:
        program.kill()
        program.wait()
    workers = [Path(f"/proc/{path.suffix[1:]}/stat") for path in folder.iterdir()]
    until(lambda: not any(path.exists() and ") Z" not in path.read_text() for path in workers), "the workers to end")
