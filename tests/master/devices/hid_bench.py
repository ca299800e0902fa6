"""A bench for a HID device in two processes: only a process that is started into a testbed sees the device.

`HidBenches` is the outer process, which keeps the testbed and the emulator; `outer_bench` reaches it from the inner
one, which has the driver on the real hidapi.
"""

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from multiprocessing.connection import Client, Connection, Listener
from pathlib import Path
from threading import Thread
from time import monotonic
from types import TracebackType
from typing import Any, Self

from weberlink.geometry.vector import Vector
from weberlink.hardware.umockdev import Testbed, plugged_into
from weberlink.master.emulators import load as load_emulator

ADDRESS = "WEBERLINK_TEST_HID_BENCH"
"""Variable that says where the outer process listens; where it is missing there is none."""

END = ""
"""In place of a name."""
FAULTS = ("unplug", "silent", "late", "restart")
"""Not garbled: USB has a checksum of its own, and a report that is wrong does not arrive."""


class HidBenches:
    """The outer process: the device that whoever connects names, for as long as the connection lasts.

    Args:
        testbed: that the inner process was started into.
        address: of the socket to make.
    """

    def __init__(self, testbed: Testbed, address: Path) -> None:
        self._testbed = testbed
        self._listener = Listener(str(address), "AF_UNIX")
        self._thread = Thread(target=self._listen)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        with Client(self._listener.address, "AF_UNIX") as last:
            last.send(END)
        self._thread.join()
        self._listener.close()

    def _listen(self) -> None:
        while True:
            with self._listener.accept() as connection:
                if (name := connection.recv()) == END:
                    return
                self._serve(name, connection)

    def _serve(self, name: str, connection: Connection) -> None:
        emulator_class = load_emulator(name)
        emulator: Any = emulator_class(emulator_class.Options())
        with plugged_into(self._testbed, emulator) as node:

            def felt() -> Vector:
                if not node.plugged:  # nobody serves it any more, and its time goes on all the same
                    emulator.advance(monotonic())
                force: Vector = emulator.force
                return force

            faults: dict[str, Callable[[], object]] = {
                "unplug": node.unplug,
                "silent": lambda: setattr(emulator.faults, "silent", True),
                "late": lambda: setattr(emulator.faults, "late_s", 0.2),
                "restart": lambda: emulator.inject("restart", 1.0),
                "felt": felt,
            }
            connection.send(node.node)
            try:
                while True:
                    connection.send(faults[connection.recv()]())
            except EOFError:
                return


@contextmanager
def outer_bench(name: str) -> Iterator[tuple[str, Callable[[str], Any]]]:
    """In the inner process: path of a fresh device, and how to ask the outer one for a fault or a figure."""
    with Client(os.environ[ADDRESS], "AF_UNIX") as connection:
        connection.send(name)
        path = connection.recv()

        def ask(what: str) -> Any:
            connection.send(what)
            return connection.recv()

        yield path, ask
