"""The simulated robot as a process: started, waited for, stalled, killed."""

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from random import Random
from time import monotonic, sleep

from tests.franka.truth import Truth

PROGRAM = (sys.executable, "-m", "tests.franka.simulator")
READY = "Server ready for new client connection"
READY_S = 60.0
STOP_S = 10.0


def own_address() -> str:
    """A loopback address of this process: libfranka has one port, and others may simulate a robot here too."""
    random = Random(os.getpid())
    return f"127.{random.randrange(1, 255)}.{random.randrange(256)}.{random.randrange(1, 255)}"


class SimulatedRobot:
    """franka-sim in a process of its own.

    Args:
        folder: for its log and the record of the truth.
        host: where it listens.
        lenient: whether lost cycles and broken limits do not stop the arm.
    """

    def __init__(self, folder: Path, host: str, lenient: bool = False) -> None:
        self.host = host
        self.truth = Truth(folder / f"truth-{os.getpid()}.rows")
        self.log = folder / "simulator.log"
        with self.log.open("wb") as log:
            self._process = subprocess.Popen(
                [
                    *PROGRAM,
                    "--host",
                    host,
                    "--truth",
                    str(self.truth.path),
                    "--parent",
                    str(os.getpid()),
                    *["--lenient"] * lenient,
                ],
                stdout=log,
                stderr=log,
                stdin=subprocess.DEVNULL,
                start_new_session=True,
            )

    @property
    def pid(self) -> int:
        return self._process.pid

    def wait_until_ready(self) -> None:
        """Until it waits for a client. (franka-sim's own check takes states from 127.0.0.1 only.)

        Raises:
            RuntimeError: it ended or did not become ready; the message has the end of its log.
        """
        deadline = monotonic() + READY_S
        while self._process.poll() is None and monotonic() < deadline:
            if READY in self.log.read_text(encoding="utf-8"):
                return
            sleep(0.1)
        raise RuntimeError(f"franka-sim did not become ready:\n{self.tail()}")

    def tail(self, lines: int = 20) -> str:
        return "\n".join(self.log.read_text(encoding="utf-8").splitlines()[-lines:])

    def signal(self, number: signal.Signals) -> None:
        with suppress(ProcessLookupError):
            os.kill(self.pid, number)

    def provoke_reflex(self) -> None:
        self.signal(signal.SIGUSR1)

    def kill(self) -> None:
        self.signal(signal.SIGKILL)
        self._process.wait()

    def close(self) -> None:
        if self._process.poll() is not None:
            return
        self.signal(signal.SIGCONT)
        self.signal(signal.SIGINT)
        try:
            self._process.wait(STOP_S)
        except subprocess.TimeoutExpired:
            self.kill()


@contextmanager
def simulated_robot(folder: Path, host: str, lenient: bool = False) -> Iterator[SimulatedRobot]:
    """A robot that answers; nothing of it is left at the end."""
    robot = SimulatedRobot(folder, host, lenient)
    try:
        robot.wait_until_ready()
        yield robot
    finally:
        robot.close()
