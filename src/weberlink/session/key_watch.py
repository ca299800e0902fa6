"""Notices in a running slave that its keys have changed. A key that is gone, or is to do less now, ends its session."""

import os
from collections.abc import Callable, Sequence
from operator import attrgetter
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING

from weberlink.protocol.keys import HeldKey, load

if TYPE_CHECKING:
    import asyncio

    from weberlink.config import Configuration
    from weberlink.config.finders import PathFinder
    from weberlink.protocol.endpoint import Endpoint
    from weberlink.protocol.psk import Keyring
    from weberlink.protocol.security import Security

_IDENTITY = attrgetter("st_ino", "st_size", "st_mtime_ns", "st_mode", "st_uid")
LOOK_S = 0.3
"""Between two looks [s]. Keys that cannot be read twice in a row are gone: an editor may be replacing their file."""


class KeyWatch:
    """Looks at the keys again and again, in a thread of the loop: a disk may be slow."""

    def __init__(
        self, where: Path, read: Callable[[], Sequence[HeldKey]], keyring: "Keyring", endpoint: "Endpoint"
    ) -> None:
        self._where, self._read, self._keyring, self._endpoint = where, read, keyring, endpoint
        self._seen: object = None
        self._unread = 0
        self._loop: asyncio.AbstractEventLoop | None = None

    def open(self, loop: "asyncio.AbstractEventLoop") -> None:
        self._loop = loop
        self._look()

    def close(self) -> None:
        self._loop = None

    def _look(self) -> None:
        if self._loop is not None:
            self._loop.run_in_executor(None, self._changed).add_done_callback(self._on_look)

    def _changed(self) -> Sequence[HeldKey] | None:
        """The keys, if they may be others than at the last look."""
        try:
            files = sorted(self._where.iterdir()) if self._where.is_dir() else [self._where]
            # Differs when a file of keys was written, replaced, added or removed.
            seen = [(file.name, *_IDENTITY(os.lstat(file))) for file in files]
            if seen == self._seen:
                return None
            keys = self._read()
        except (ValueError, OSError):
            self._seen = None
            self._unread += 1
            return [] if self._unread > 1 else None
        self._seen, self._unread = seen, 0
        return keys

    def _on_look(self, done: "asyncio.Future[Sequence[HeldKey] | None]") -> None:
        if self._loop is None or done.cancelled():
            return
        keys = done.result()
        if keys is not None:
            self._keyring.replace(keys)
            self._endpoint.check_keys(monotonic())
        self._loop.call_later(LOOK_S, self._look)


def key_watch(
    configuration: "Configuration", finder: "PathFinder | None", security: "Security", endpoint: "Endpoint"
) -> KeyWatch | None:
    """The watch over the keys of a slave; None where it has none that are stored."""
    link = configuration.system.link
    if finder is None and link.security != "psk":
        return None
    from weberlink.protocol.psk import Keyring  # noqa: PLC0415 - where there is a key

    if not isinstance(security, Keyring):
        return None
    if finder is not None:
        return KeyWatch(*finder.stored_keys(), security, endpoint)
    path = link.key_file
    return None if path is None else KeyWatch(path, lambda: load(path), security, endpoint)
