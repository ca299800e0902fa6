"""A recording beside the session, on a disk that stalls or fills up. Owns the recorder's process and its file."""

import signal
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from os import kill
from pathlib import Path

from tests.soak.rig import SIDES, Rig
from tests.soak.watch import Watch
from weberlink.system.recorder import Recorder

SIZE_KIB = 192
FULL_S = 30.0
"""By when a disk of that size must be full: a session writes some hundred KiB a second."""


class MountError(RuntimeError):
    """There is no small disk to be had."""


@contextmanager
def recording(rig: Rig, watch: Watch, folder: Path | None = None) -> Iterator[Recorder]:
    """Record what the daemons of the rig do meanwhile; the file is removed at the end."""
    out = (folder or rig.folder) / "soak.mcap"
    recorder = Recorder(rig.configuration, {side: rig.ring(side) for side in SIDES}, out)
    watch.extra["recorder"] = recorder.pid
    try:
        yield recorder
    finally:
        del watch.extra["recorder"]
        if recorder.running:
            kill(recorder.pid, signal.SIGCONT)
            kill(recorder.pid, signal.SIGTERM)
            watch.until(lambda: not recorder.running, 10.0)
        recorder.finish()
        out.unlink(missing_ok=True)


def mount(folder: Path) -> Path:
    """A disk of `SIZE_KIB`, in memory, below a folder.

    Raises:
        MountError: it is not permitted.
    """
    small = folder / "small"
    small.mkdir(exist_ok=True)
    ended = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", f"size={SIZE_KIB}k", "none", str(small)],
        capture_output=True,
        text=True,
        check=False,
    )
    if ended.returncode != 0:
        small.rmdir()
        raise MountError(ended.stderr.strip() or "no tmpfs can be mounted")
    return small


def unmount(small: Path) -> None:
    subprocess.run(["umount", str(small)], check=True)
    small.rmdir()
