"""An emulated serial device: a pseudo terminal under a path of its own, served by a thread."""

import os
import tty
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from threading import Event, Thread
from types import TracebackType
from typing import Self

from weberlink.hardware.emulator import Emulator, serve


class PtyDevice:
    """While in the `with`, `path` is a serial port with the emulator at its other end.

    Args:
        emulator: the device; the thread that serves it is the only one to call its methods.
        path: of the link that is made; must not exist yet.
        begin: called first in that thread, to give it a priority for example.
    """

    def __init__(self, emulator: Emulator, path: Path, *, begin: Callable[[], object] = lambda: None) -> None:
        self.emulator = emulator
        self.path = path
        self._begin = begin
        self._descriptors: tuple[int, int] | None = None
        self._stopping = Event()
        self._thread: Thread | None = None

    def __enter__(self) -> Self:
        self.plug()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.unplug()

    @property
    def plugged(self) -> bool:
        return self._descriptors is not None

    @property
    def serving(self) -> bool:
        """Whether somebody answers there; not so either after a mistake in the emulator."""
        return self._thread is not None and self._thread.is_alive()

    def plug(self) -> None:
        """Make the port; the same path after every `unplug`.

        Raises:
            FileExistsError: there is something at the path.
        """
        assert self._descriptors is None
        near, far = os.openpty()
        try:
            self._prepare(far)
            os.set_blocking(near, False)
            self.path.symlink_to(os.ttyname(far))
        except BaseException:
            os.close(near)
            os.close(far)
            raise
        self._descriptors = (near, far)  # the far end stays open: without one, the near end gives errors
        self._stopping.clear()
        self._thread = Thread(target=self._run, args=self._descriptors, daemon=True)
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

    def _run(self, near: int, far: int) -> None:
        self._begin()
        self._serve(near, far)

    def _prepare(self, far: int) -> None:
        """Set up the end that the host opens."""
        tty.setraw(far)

    def _serve(self, near: int, far: int) -> None:  # noqa: ARG002 - for those that have to look at the queue there
        serve(self.emulator, near, self._stopping.is_set)
