"""An emulated serial device: a pseudo terminal under a path of its own, served by a thread."""

import os
import tty
from contextlib import suppress
from pathlib import Path
from threading import Event, Thread
from types import TracebackType
from typing import Self

from hardware.emulator import Emulator, serve


class PtyDevice:
    """While in the `with`, `path` is a serial port with the emulator at its other end.

    Args:
        emulator: the device; the thread that serves it is the only one to call its methods.
        path: of the link that is made; must not exist yet.
    """

    def __init__(self, emulator: Emulator, path: Path) -> None:
        self.emulator = emulator
        self.path = path
        self._descriptors: tuple[int, int] | None = None
        self._stopping = Event()
        self._thread: Thread | None = None

    def __enter__(self) -> Self:
        self.plug()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.unplug()

    def plug(self) -> None:
        """Make the port; the same path after every `unplug`."""
        assert self._descriptors is None
        near, far = os.openpty()
        tty.setraw(far)
        os.set_blocking(near, False)
        self._descriptors = (near, far)  # the far end stays open: without one, the near end gives errors
        self.path.symlink_to(os.ttyname(far))
        self._stopping.clear()
        self._thread = Thread(target=serve, args=(self.emulator, near, self._stopping.is_set), daemon=True)
        self._thread.start()

    def unplug(self) -> None:
        """Take the port away; whoever has it open gets an error. Any number of times."""
        if self._descriptors is None:
            return
        self._stopping.set()
        assert self._thread is not None
        self._thread.join()
        for descriptor in self._descriptors:
            os.close(descriptor)
        self._descriptors = None
        with suppress(FileNotFoundError):
            self.path.unlink()
