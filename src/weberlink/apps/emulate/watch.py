"""What runs beside an emulated device and what it waits for: lines, signals, a command and its end."""

import os
import selectors
import signal
import stat
import subprocess
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

from weberlink.apps.emulate.fault_lines import FaultLines
from weberlink.hardware.emulator import PtyDevice
from weberlink.system.configuration import ConfigurationError
from weberlink.system.daemon import COMPLETED, FAILED

STOP_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
LOOK_S = 0.2
"""Between two looks at whether the emulator still answers."""
STOP_LIMIT_S = 3.0
"""From a request to stop to a kill."""
CHUNK = 4096


@contextmanager
def fifo(path: Path) -> Iterator[int]:
    """A descriptor that lines come from, whoever writes them, and never an end."""
    made = False
    try:
        if not path.exists():
            os.mkfifo(path, 0o600)
            made = True
        elif not stat.S_ISFIFO(path.stat().st_mode):
            raise ConfigurationError(f"--faults {path}: is there already and is no FIFO")
        descriptor = os.open(path, os.O_RDWR | os.O_NONBLOCK)
    except OSError as error:
        raise ConfigurationError(f"--faults {path}: cannot be opened: {error.strerror}") from None
    try:
        yield descriptor
    finally:
        os.close(descriptor)
        if made:
            path.unlink(missing_ok=True)


@contextmanager
def stop_signals() -> Iterator[int]:
    """A descriptor that gives the number of each signal that asks to stop, as a byte."""
    reading, writing = os.pipe2(os.O_NONBLOCK | os.O_CLOEXEC)
    before = signal.set_wakeup_fd(writing)
    # One that is ignored already, by nohup for example, stays so.
    handlers = {each: signal.getsignal(each) for each in STOP_SIGNALS if signal.getsignal(each) is not signal.SIG_IGN}
    for number in handlers:
        signal.signal(number, lambda *_: None)
    try:
        yield reading
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
        signal.set_wakeup_fd(before)
        os.close(reading)
        os.close(writing)


@contextmanager
def child_process(command: Sequence[str], environment: Mapping[str, str]) -> Iterator[subprocess.Popen[bytes]]:
    """A process that does not outlive the `with`."""
    try:
        child = subprocess.Popen(command, env=environment)  # noqa: S603 - the user's own
    except OSError as error:
        raise ConfigurationError(f"{command[0]}: cannot be run: {error.strerror}") from None
    try:
        yield child
    finally:
        if child.poll() is None:
            child.terminate()
            try:
                child.wait(STOP_LIMIT_S)
            except subprocess.TimeoutExpired:
                child.kill()
                child.wait()


class Watch:
    """Waits for lines, signals and the end of the command.

    Args:
        device: on its port.
        lines: to hand lines to.
        signals: descriptor of signals.
        sources: descriptors of lines.
        child: the command, if there is one.
    """

    def __init__(
        self,
        device: PtyDevice,
        lines: FaultLines,
        signals: int,
        sources: Sequence[int],
        child: subprocess.Popen[bytes] | None,
    ) -> None:
        self._device = device
        self._lines = lines
        self._signals = signals
        self._rests = dict.fromkeys(sources, b"")
        self._child = child
        self._interrupts = 0

    def run(self) -> int:
        # Not the default one, which cannot wait for a file.
        with selectors.SelectSelector() as selector, ExitStack() as stack:
            for descriptor in (self._signals, *self._rests):
                selector.register(descriptor, selectors.EVENT_READ)
            if self._child is not None:
                ended = os.pidfd_open(self._child.pid)
                stack.callback(os.close, ended)
                selector.register(ended, selectors.EVENT_READ)
            while (status := self._once(selector)) is None:
                pass
        return status

    def _once(self, selector: selectors.BaseSelector) -> int | None:
        for key, _ in selector.select(LOOK_S):
            if key.fd == self._signals:
                if self._child is None:
                    return COMPLETED
                self._pass_on(self._child)
            elif key.fd not in self._rests:
                assert self._child is not None
                status = self._child.wait()
                return status if status >= 0 else 128 - status
            elif not self._read(key.fd):
                selector.unregister(key.fd)
        return FAILED if self._device.plugged and not self._device.serving else None

    def _read(self, descriptor: int) -> bool:
        """Obey the lines that have come; False at the end of them."""
        try:
            data = os.read(descriptor, CHUNK)
        except BlockingIOError:
            return True
        except OSError:  # of a terminal in whose background this runs
            return False
        *lines, rest = (self._rests[descriptor] + data).split(b"\n")
        self._rests[descriptor] = rest[-CHUNK:]
        for line in lines:
            self._lines.obey(line.decode(errors="replace"))
        return bool(data)

    def _pass_on(self, child: subprocess.Popen[bytes]) -> None:
        """Signals go to the command, whose end is ours; the second Ctrl-C makes it end."""
        for number in os.read(self._signals, 64):
            if number != signal.SIGINT:
                child.send_signal(number)
                continue
            self._interrupts += 1
            if self._interrupts > 1:
                child.terminate()
            elif not _in_foreground():  # else the terminal has told it too
                child.send_signal(number)


def _in_foreground() -> bool:
    with suppress(OSError):
        terminal = os.open("/dev/tty", os.O_RDONLY | os.O_NOCTTY)
        try:
            return os.tcgetpgrp(terminal) == os.getpgrp()
        finally:
            os.close(terminal)
    return False
