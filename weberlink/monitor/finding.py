"""The rings of this host, by the launcher that started their daemons. Knows names of files only."""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from telemetry.ring import default_path
from weberlink.configuration import SIDES

_NAME = re.compile(rf"weberlink-(\d+)-({'|'.join(SIDES)})\.ring")


class Found(NamedTuple):
    """One ring file; `number` is its inode, which tells it from an earlier file of the same name."""

    session: str
    side: str
    path: Path
    number: int
    changed: float
    """When the file was made or last written through its name, wall clock [s]."""


def folder() -> Path:
    return default_path("any").parent


def find(where: Path) -> dict[str, dict[str, Found]]:
    """Rings by session and side, the newest session last; a session is called by its launcher's process id."""
    sessions: dict[str, dict[str, Found]] = {}
    for path in where.glob("weberlink-*.ring"):
        match = _NAME.fullmatch(path.name)
        if match is None:
            continue
        try:
            status = path.stat()
        except FileNotFoundError:
            continue
        session, side = match.groups()
        sessions.setdefault(session, {})[side] = Found(session, side, path, status.st_ino, status.st_ctime)
    return dict(sorted(sessions.items(), key=lambda item: _begun(item[1])))


def _begun(rings: Mapping[str, Found]) -> float:
    return min(found.changed for found in rings.values())
