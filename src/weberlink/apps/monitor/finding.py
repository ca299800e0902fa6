"""The rings of this user on this host, by the launcher that started their daemons. Knows names of files only."""

import re
import stat
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from weberlink.system.configuration import SIDES
from weberlink.telemetry.runtime_directory import directories

_NAME = re.compile(rf"weberlink-(\d+)-({'|'.join(SIDES)})\.ring")


class Found(NamedTuple):
    """One ring file; `number` is its inode, which tells it from an earlier file of the same name."""

    session: str
    side: str
    path: Path
    number: int
    changed: float
    """When the file was made or last written through its name, wall clock [s]."""


def find(where: Path | None) -> dict[str, dict[str, Found]]:
    """Rings by session and side, the newest session last; a session is called by its launcher's process id.

    Args:
        where: the folder to look in; None for the runtime directories of this user, in which no other user can make
            anything.
    """
    sessions: dict[str, dict[str, Found]] = {}
    for path in (path for folder in (directories() if where is None else [where]) for path in folder.glob("*.ring")):
        match = _NAME.fullmatch(path.name)
        if match is None:
            continue
        try:
            status = path.lstat()
        except FileNotFoundError:
            continue
        if stat.S_ISREG(status.st_mode):
            session, side = match.groups()
            sessions.setdefault(session, {})[side] = Found(session, side, path, status.st_ino, status.st_ctime)
    return dict(sorted(sessions.items(), key=lambda item: _begun(item[1])))


def _begun(rings: Mapping[str, Found]) -> float:
    return min(found.changed for found in rings.values())
