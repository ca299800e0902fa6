"""Commands in a control group or in a PID namespace of their own, and the end of these."""

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from shutil import which

from tests.wait import until

NAMESPACE = ("unshare", "--pid", "--fork", "--kill-child", "--mount-proc", "sh", "-c", '"$@"; true', "init")
"""Before a command: it runs in a namespace whose init ends with this process, and all that is in there with that."""


def namespaces() -> bool:
    """Whether this user may make one."""
    return which("unshare") is not None and os.geteuid() == 0


class ControlGroup:
    """Of the unified hierarchy.

    Attributes:
        prefix: Of a command that is to run in it.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self.prefix = ("sh", "-c", 'echo $$ >"$0/cgroup.procs" && exec "$@"', str(folder))

    def kill(self) -> None:
        """All that is in it, at once."""
        (self._folder / "cgroup.kill").write_text("1")

    def freeze(self) -> None:
        (self._folder / "cgroup.freeze").write_text("1")

    @property
    def processes(self) -> list[int]:
        return [int(pid) for pid in (self._folder / "cgroup.procs").read_text().split()]


@contextmanager
def control_group() -> Iterator[ControlGroup | None]:
    """None where this user may make none."""
    mounts = Path("/proc/self/mountinfo").read_text(encoding="ascii").splitlines()
    root = next((Path(line.split()[4]) for line in mounts if " - cgroup2 " in line), Path())
    folder = root / f"weberlink-test-{os.getpid()}"
    try:
        folder.mkdir()
    except OSError:
        yield None
        return
    group = ControlGroup(folder)
    try:
        yield group
    finally:
        with suppress(OSError):
            group.kill()
        until(lambda: not group.processes, "the control group to be empty")
        folder.rmdir()
