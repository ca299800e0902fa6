"""Gives the pictures of a session to those on this host who ask (`weberlink_figures.pictures`)."""

import asyncio
import os
from contextlib import suppress
from pathlib import Path
from typing import Final

from weberlink_figures.pictures import Picture, pack
from weberlink_video.options import MOST_CAMERAS

MOST_WAITING: Final = 2**22  # of bytes that who reads slowly has not taken; it misses pictures from there on
MOST_READERS: Final = 32


class Hub:
    """Serves a socket at a path, until it is closed."""

    def __init__(self, path: Path) -> None:
        self.newest: dict[str, Picture] = {}  # by camera
        self._path = path
        self._readers: set[asyncio.StreamWriter] = set()
        self._server: asyncio.Server | None = None

    async def open(self) -> None:
        self._path.unlink(missing_ok=True)
        before = os.umask(0o177)
        try:
            self._server = await asyncio.start_unix_server(self._serve, str(self._path))
        finally:
            os.umask(before)

    def put(self, picture: Picture) -> None:
        if picture.camera not in self.newest and len(self.newest) >= MOST_CAMERAS:
            return  # the other end names the cameras: names without end would fill the memory
        self.newest[picture.camera] = picture
        data = pack(picture)
        for reader in self._readers:
            if reader.transport.get_write_buffer_size() + len(data) <= MOST_WAITING:
                reader.write(data)

    def close(self) -> None:
        self._path.unlink(missing_ok=True)
        if self._server is not None:
            self._server.close()
        for reader in self._readers:
            reader.transport.abort()

    async def _serve(self, asks: asyncio.StreamReader, reader: asyncio.StreamWriter) -> None:
        if len(self._readers) < MOST_READERS:
            self._readers.add(reader)
            for picture in self.newest.values():
                reader.write(pack(picture))
            with suppress(ConnectionError):
                while await asks.read(1024):
                    pass  # nobody has anything to say here
            self._readers.discard(reader)
        reader.transport.abort()
