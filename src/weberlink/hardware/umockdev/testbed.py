"""The process that keeps an emulated /sys, and how another process comes to see it."""

import json
import os
import shutil
import subprocess
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from weberlink.hardware.fault import HardwareFault
from weberlink.hardware.umockdev.description import HidIdentity, description, ioctls, node_of, paths

WRAPPER = "umockdev-wrapper"
SYSTEM_PYTHON = "/usr/bin/python3"
"""Not the one of a virtual environment: the bindings come with the distribution."""
PRELOAD = "libumockdev-preload.so.0"
ADVICE = "to emulate HID devices, install umockdev: apt-get install umockdev gir1.2-umockdev-1.0 python3-gi"
END_S = 5.0


def missing() -> str | None:
    """Why there can be no testbed here, with what to do about it; None if there can."""
    try:
        with Testbed():
            return None
    except HardwareFault as fault:
        return str(fault)


class Testbed:
    """While in the `with`, processes that are started with `environment` see these HID devices.

    They see no other USB devices, serial ones included. What they read and write there goes through the testbed's
    process.

    Args:
        priority: of SCHED_FIFO for that process, where it is permitted; 0 for none.

    Raises:
        HardwareFault: umockdev is not installed, or fails.
    """

    __test__ = False  # not one of pytest's, in spite of its name

    def __init__(self, priority: int = 0) -> None:
        self._priority = priority
        self._process: subprocess.Popen[str] | None = None
        self._instances = 0
        self._plugged: dict[int, tuple[HidIdentity, int]] = {}
        self._described: dict[int, HidIdentity] = {}
        self.root = Path()
        """What takes the place of / for those that see it."""

    @property
    def environment(self) -> dict[str, str]:
        """All variables for a process that is to see the devices."""
        preload = ":".join(filter(None, (PRELOAD, os.environ.get("LD_PRELOAD", ""))))
        return {**os.environ, "LD_PRELOAD": preload, "UMOCKDEV_DIR": str(self.root)}

    def __enter__(self) -> Self:
        if shutil.which(WRAPPER) is None or not Path(SYSTEM_PYTHON).exists():
            raise HardwareFault(ADVICE)
        self._process = subprocess.Popen(  # noqa: S603
            [WRAPPER, SYSTEM_PYTHON, "-I", str(Path(__file__).with_name("service.py")), str(self._priority)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            start_new_session=True,  # Ctrl-C is for us; it ends with its input
            text=True,
        )
        try:
            self.root = self._first_answer()
        except BaseException:
            self._end()
            raise
        (self.root / "dev").mkdir(exist_ok=True)
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._end()

    def free_number(self) -> int:
        """Of the next node, as the kernel would count."""
        return next(number for number in range(len(self._plugged) + 1) if number not in self._plugged)

    def path(self, number: int) -> Path:
        """Where the node of that number is for those that do not see the testbed."""
        return self.root / node_of(number).removeprefix("/")

    def plug(self, identity: HidIdentity, number: int) -> None:
        """Let the device appear; its node in /dev is up to the caller."""
        self._instances += 1
        self._ask(
            {
                "add": description(identity, number, self._instances),
                "ioctls": ioctls(identity, number) if self._described.get(number) != identity else "",
            }
        )
        self._described[number] = identity
        self._plugged[number] = (identity, self._instances)

    def unplug(self, number: int) -> None:
        """Let it disappear; any number of times."""
        if number in self._plugged:
            identity, instance = self._plugged.pop(number)
            # From the inside out: umockdev forgets some links of what is within the thing that it removes.
            self._ask({"remove": [f"/sys{path}" for path in reversed(paths(identity, number, instance))]})

    def _ask(self, order: dict[str, Any]) -> None:
        assert self._process is not None
        assert self._process.stdin is not None
        with suppress(BrokenPipeError):  # the answer will be missing then
            self._process.stdin.write(json.dumps(order) + "\n")
            self._process.stdin.flush()
        answer = self._answer()
        if answer:
            raise HardwareFault(f"umockdev: {answer.get('error', answer)}")

    def _first_answer(self) -> Path:
        answer = self._answer()
        if "root" not in answer:
            raise HardwareFault(ADVICE)
        return Path(answer["root"])

    def _answer(self) -> dict[str, Any]:
        assert self._process is not None
        assert self._process.stdout is not None
        assert self._process.stderr is not None
        line = self._process.stdout.readline()
        if not line.startswith("{"):
            complaint = (line + self._process.stderr.read()).strip().splitlines()
            raise HardwareFault(f"umockdev: {complaint[-1] if complaint else 'ended without a word'}")
        answer: dict[str, Any] = json.loads(line)
        return answer

    def _end(self) -> None:
        process, self._process = self._process, None
        if process is None:
            return
        for stream in (process.stdin, process.stdout, process.stderr):
            assert stream is not None
            with suppress(BrokenPipeError):
                stream.close()
        try:
            process.wait(END_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
        if self.root != Path() and self.root.name.startswith("umockdev."):
            shutil.rmtree(self.root, ignore_errors=True)  # of a killed one
        self._plugged.clear()
        self._described.clear()
