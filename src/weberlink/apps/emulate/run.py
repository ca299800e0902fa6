"""Runs an emulated device: builds its emulator, connects it to a port, and reads commands until the end."""

import os
import selectors
import signal
import stat
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from difflib import get_close_matches
from pathlib import Path
from typing import Any, TextIO

import yaml
from pydantic import ValidationError

from weberlink.apps.emulate.fault_commands import FaultCommands
from weberlink.hardware.fault import HardwareFault
from weberlink.hardware.pty_device import PtyDevice
from weberlink.hardware.umockdev import HidNode, Testbed
from weberlink.master import emulators as devices
from weberlink.realtime.process import prepare
from weberlink.slave import emulators as robots
from weberlink.system.configuration import ConfigurationError
from weberlink.system.configuration.document import override
from weberlink.system.configuration.errors import describe
from weberlink.system.daemon import COMPLETED, FAILED

PORT = "{port}"
"""Placeholder for the port in the arguments of the command."""
PRIORITY = 60
"""Above the daemons, since a real device has its own processor."""
STOP_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
LOOK_S = 0.2
"""Period of checking that the emulator still runs."""
STOP_LIMIT_S = 3.0
"""Time from SIGTERM to SIGKILL."""
CHUNK = 4096


def names() -> list[str]:
    """Devices that can be emulated, by the names of their drivers."""
    return sorted({**devices.EMULATORS, **robots.EMULATORS})


def run(
    name: str,
    link: Path | None,
    overrides: Sequence[str],
    command: Sequence[str],
    *,
    out: TextIO,
    source: TextIO | None,
    faults: Path | None = None,
) -> int:
    """Emulate a device until a signal, or until the command ends. Call it in the main thread.

    Args:
        name: driver of the device.
        link: path of a serial device's port; weberlink-NAME in the working directory if None.
        overrides: "key=value" for the emulator's options.
        command: to run meanwhile; `{port}` in it is replaced by the port. Only this command sees a HID device.
        out: stream for the line with the port, and for answers.
        source: stream of fault commands; not read while a command runs, which then has standard input.
        faults: FIFO of fault commands; created and removed if it does not exist.

    Returns:
        The exit status of the command; without a command 0, or 1 if the emulator failed.

    Raises:
        ConfigurationError: an argument is wrong, or umockdev is missing for a HID device.
    """
    section, emulator = _build(name, overrides)
    if emulator.transport == "hid" and not command:
        raise ConfigurationError(f"{name}: a HID device is visible to one command only; give it: -- COMMAND...")
    with ExitStack() as stack:
        signals = stack.enter_context(stop_signals())
        device, port, environment = _put_on(stack, name, emulator, link)
        sources = []
        if faults is not None:
            sources.append(stack.enter_context(fifo(faults)))
        if source is not None and not command:
            # Reading from a terminal in the background must not stop this process.
            before = signal.signal(signal.SIGTTIN, signal.SIG_IGN)
            stack.callback(signal.signal, signal.SIGTTIN, before)
            sources.append(source.fileno())
        commands = FaultCommands(name, emulator, device, out)
        settings = yaml.safe_dump({"driver": name, "port": port}, default_flow_style=True, width=sys.maxsize).strip()
        commands.say(f"{name} is at {port}; configure it as {section}: {settings}")
        arguments = [argument.replace(PORT, port) for argument in command]
        child = stack.enter_context(child_process(arguments, environment)) if command else None
        return EmulationLoop(device, commands, signals, sources, child).run()


def _hurry() -> None:
    """Raise the priority of the thread that answers for the device, if permitted."""
    prepare(PRIORITY, lock_memory=False, cpu=None)


def _build(name: str, overrides: Sequence[str]) -> tuple[str, Any]:
    """The section of a configuration that names such a device, and the emulator."""
    tables: Mapping[str, Any] = {"master.device": devices, "slave.robot": robots}
    section = next((section for section, table in tables.items() if name in table.EMULATORS), None)
    if section is None:
        nearest = get_close_matches(name, names(), n=1, cutoff=0.0)
        raise ConfigurationError(
            f"no emulated device is called {name!r}; nearest is {nearest[0]!r}, there are {', '.join(names())}"
        )
    emulator_class = tables[section].load(name)
    content: dict[str, Any] = {}
    for text in overrides:
        override(content, text)
    try:
        options = emulator_class.Options.model_validate(content)
    except ValidationError as error:
        raise ConfigurationError(f"--set {describe(error, emulator_class.Options, ())}") from None
    return section, emulator_class(options)


def _put_on(stack: ExitStack, name: str, emulator: Any, link: Path | None) -> tuple[PtyDevice, str, dict[str, str]]:
    """The device, its port, and the environment of processes that use it."""
    try:
        if emulator.transport == "hid":
            if link is not None:
                raise ConfigurationError(f"--link: the path of a HID device cannot be chosen; omit it for {name}")
            testbed = stack.enter_context(Testbed(PRIORITY))
            node = stack.enter_context(HidNode(testbed, emulator, emulator.identity, begin=_hurry))
            return node, node.node, testbed.environment
        path = Path.cwd() / (link or f"weberlink-{name}")
        if path.is_symlink() and path.readlink().is_relative_to("/dev/pts") and not path.exists():
            path.unlink()  # left by a process that was killed
        return stack.enter_context(PtyDevice(emulator, path, begin=_hurry)), str(path), dict(os.environ)
    except FileExistsError as error:
        raise ConfigurationError(f"{error.filename2 or path}: exists already; choose another with --link") from None
    except OSError as error:
        raise ConfigurationError(f"{error.filename2 or path}: cannot be created: {error.strerror}") from None
    except HardwareFault as fault:
        raise ConfigurationError(f"{name}: {fault}") from None


@contextmanager
def fifo(path: Path) -> Iterator[int]:
    """A descriptor of a FIFO that has no end of file."""
    made = False
    try:
        if not path.exists():
            os.mkfifo(path, 0o600)
            made = True
        elif not stat.S_ISFIFO(path.stat().st_mode):
            raise ConfigurationError(f"--faults {path}: exists already and is no FIFO")
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
    """A descriptor that gives the number of each stop signal as a byte."""
    reading, writing = os.pipe2(os.O_NONBLOCK | os.O_CLOEXEC)
    before = signal.set_wakeup_fd(writing)
    # A signal that is ignored already, by nohup for example, stays ignored.
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
    """A process that ends with the `with` block."""
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


class EmulationLoop:
    """Waits for commands, signals and the end of the child.

    Args:
        device: on its port.
        commands: executes lines.
        signals: descriptor of stop signals.
        sources: descriptors of lines.
        child: the process of the command, if there is one.
    """

    def __init__(
        self,
        device: PtyDevice,
        commands: FaultCommands,
        signals: int,
        sources: Sequence[int],
        child: subprocess.Popen[bytes] | None,
    ) -> None:
        self._device = device
        self._commands = commands
        self._signals = signals
        self._rests = dict.fromkeys(sources, b"")
        self._child = child
        self._interrupts = 0

    def run(self) -> int:
        # The default selector cannot wait for a regular file.
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
        """Execute the lines received; False at the end of input."""
        try:
            data = os.read(descriptor, CHUNK)
        except BlockingIOError:
            return True
        except OSError:  # a terminal, while this runs in the background
            return False
        *lines, rest = (self._rests[descriptor] + data).split(b"\n")
        self._rests[descriptor] = rest[-CHUNK:]
        for line in lines:
            self._commands.execute(line.decode(errors="replace"))
        return bool(data)

    def _pass_on(self, child: subprocess.Popen[bytes]) -> None:
        """Forward signals to the command; the second Ctrl-C terminates it."""
        for number in os.read(self._signals, 64):
            if number != signal.SIGINT:
                child.send_signal(number)
                continue
            self._interrupts += 1
            if self._interrupts > 1:
                child.terminate()
            elif not _in_foreground():  # otherwise the terminal has sent it too
                child.send_signal(number)


def _in_foreground() -> bool:
    with suppress(OSError):
        terminal = os.open("/dev/tty", os.O_RDONLY | os.O_NOCTTY)
        try:
            return os.tcgetpgrp(terminal) == os.getpgrp()
        finally:
            os.close(terminal)
    return False
