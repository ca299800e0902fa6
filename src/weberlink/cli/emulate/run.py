"""Runs an emulated device: builds its emulator, connects it to a port, and reads commands until the end."""

import asyncio
import os
import selectors
import signal
import stat
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any, TextIO

import yaml

from weberlink.cli.emulate.fault_commands import FaultCommands
from weberlink.cli.tasks import first_result
from weberlink.config import ConfigurationError
from weberlink.config.document import override
from weberlink.config.errors import validated
from weberlink.hardware.emulator import PtyDevice, ServedDevice
from weberlink.hardware.emulators import EMULATORS
from weberlink.hardware.fault import HardwareFault
from weberlink.hardware.umockdev import Testbed, plugged_into
from weberlink.master.devices import DEVICES
from weberlink.master.devices.leaders import LEADERS
from weberlink.order import COMPLETED, FAILED
from weberlink.realtime.process import prepare

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
OF_THE_KERNEL = ("hid", "evdev")
"""Transports of devices that only a command in their testbed sees."""


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
        link: path of a serial device's port; weberlink-NAME in the working directory if None. Other devices have none.
        overrides: "key=value" for the emulator's options.
        command: to run meanwhile; `{port}` in it is replaced by the port. Only this command sees a HID or input device.
        out: stream for the line with the port, and for answers.
        source: stream of fault commands; not read while a command runs, which then has standard input.
        faults: FIFO of fault commands; created and removed if it does not exist.

    Returns:
        The exit status of the command; without a command 0, or 1 if the emulator failed.

    Raises:
        ConfigurationError: an argument is wrong, or umockdev is missing for a device of the kernel.
    """
    # The default selector cannot wait for a regular file, such as a redirected standard input.
    with asyncio.Runner(loop_factory=lambda: asyncio.SelectorEventLoop(selectors.SelectSelector())) as runner:
        return runner.run(_emulate(name, link, overrides, command, out, source, faults))


async def _emulate(
    name: str,
    link: Path | None,
    overrides: Sequence[str],
    command: Sequence[str],
    out: TextIO,
    source: TextIO | None,
    faults: Path | None,
) -> int:
    section, emulator = _build(name, overrides)
    if emulator.transport in OF_THE_KERNEL and not command:
        raise ConfigurationError(f"{name}: this device is visible to one command only; give it: -- COMMAND...")
    stop = _stop_signals()
    with ExitStack() as stack:
        device, port, environment = _put_on(stack, name, emulator, link)
        commands = FaultCommands(name, emulator, device, out)
        sources = [] if faults is None else [stack.enter_context(fifo(faults))]
        if source is not None and not command:
            # Reading from a terminal in the background must not stop this process.
            before = signal.signal(signal.SIGTTIN, signal.SIG_IGN)
            stack.callback(signal.signal, signal.SIGTTIN, before)
            sources.append(source.fileno())
        settings = yaml.safe_dump({"driver": name, "port": port}, default_flow_style=True, width=sys.maxsize).strip()
        commands.say(f"{name} is at {port}; configure it as {section}: {settings}")
        arguments = [argument.replace(PORT, port) for argument in command]
        end = _run_command(arguments, environment, stop) if command else _until_stopped(stop)
        return await first_result([end, _until_failed(device), *(_execute_lines(each, commands) for each in sources)])


def _hurry() -> None:
    """Raise the priority of the thread that answers for the device, if permitted."""
    prepare(PRIORITY, lock_memory=False, cpu=None)


def _build(name: str, overrides: Sequence[str]) -> tuple[str, Any]:
    """The section of a configuration that names such a device, and the emulator."""
    try:
        emulator_class: Any = EMULATORS.load(name)
    except ValueError as error:
        raise ConfigurationError(str(error)) from None
    content: dict[str, Any] = {}
    for text in overrides:
        override(content, text)
    try:
        options = validated(emulator_class.Options, content)
    except ConfigurationError as error:
        raise ConfigurationError(f"--set {error}") from None
    section = "master.device" if name in DEVICES or name in LEADERS else "slave.robot"
    return section, emulator_class(options)


def _put_on(stack: ExitStack, name: str, emulator: Any, link: Path | None) -> tuple[ServedDevice, str, dict[str, str]]:
    """The device, its port, and the environment of processes that use it."""
    if emulator.transport != "serial" and link is not None:
        raise ConfigurationError(f"--link: the path of this device cannot be chosen; omit it for {name}")
    try:
        if emulator.transport in OF_THE_KERNEL:
            return _in_the_kernel(stack, name, emulator)
        if emulator.transport == "serial":
            return *_on_a_terminal(stack, name, emulator, link), dict(os.environ)
        device = stack.enter_context(emulator.served(_hurry))
        return device, device.address, dict(os.environ)
    except OSError as error:
        raise ConfigurationError(f"{name}: cannot be served: {error.strerror}") from None
    except HardwareFault as fault:
        raise ConfigurationError(f"{name}: {fault}") from None


def _in_the_kernel(stack: ExitStack, name: str, emulator: Any) -> tuple[ServedDevice, str, dict[str, str]]:
    """The device, its node, and the environment of processes that see it."""
    try:
        testbed = stack.enter_context(Testbed(PRIORITY))
        node = stack.enter_context(plugged_into(testbed, emulator, _hurry))
    except OSError as error:
        raise ConfigurationError(f"{name}: cannot be plugged in: {error.strerror}") from None
    return node, node.node, testbed.environment


def _on_a_terminal(stack: ExitStack, name: str, emulator: Any, link: Path | None) -> tuple[ServedDevice, str]:
    """The device, and the path of its pseudo-terminal."""
    path = link or Path(f"weberlink-{name}")
    try:
        path = Path.cwd() / path
        if path.is_symlink() and path.readlink().is_relative_to("/dev/pts") and not path.exists():
            path.unlink()  # left by a process that was killed
        return stack.enter_context(PtyDevice(emulator, path, begin=_hurry)), str(path)
    except FileExistsError as error:
        raise ConfigurationError(f"{error.filename2 or path}: exists already; choose another with --link") from None
    except OSError as error:
        raise ConfigurationError(f"{error.filename2 or path}: cannot be created: {error.strerror}") from None


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


def _stop_signals() -> asyncio.Queue[int]:
    """A queue of stop signals; those that are ignored already, by nohup for example, stay ignored."""
    loop = asyncio.get_running_loop()
    numbers: asyncio.Queue[int] = asyncio.Queue()
    for number in STOP_SIGNALS:
        if signal.getsignal(number) is not signal.SIG_IGN:
            loop.add_signal_handler(number, numbers.put_nowait, number)
    return numbers


async def _until_stopped(stop: asyncio.Queue[int]) -> int:
    await stop.get()
    return COMPLETED


async def _until_failed(device: ServedDevice) -> int:
    while not device.plugged or device.serving:
        await asyncio.sleep(LOOK_S)
    return FAILED


async def _execute_lines(descriptor: int, commands: FaultCommands) -> int:
    """Execute the commands that arrive; the end of input does not end the emulation."""
    loop, pieces, rest = asyncio.get_running_loop(), asyncio.Queue[bytes](), b""

    def read() -> None:
        try:
            data = os.read(descriptor, CHUNK)
        except BlockingIOError:
            return
        except OSError:  # a terminal, while this runs in the background
            data = b""
        if not data:
            loop.remove_reader(descriptor)
        pieces.put_nowait(data)

    loop.add_reader(descriptor, read)
    try:
        while True:
            *lines, rest = (rest + await pieces.get()).split(b"\n")
            rest = rest[-CHUNK:]
            for line in lines:
                commands.execute(line.decode(errors="replace"))
    finally:
        loop.remove_reader(descriptor)


async def _run_command(arguments: Sequence[str], environment: Mapping[str, str], stop: asyncio.Queue[int]) -> int:
    """Exit status of the command, which does not outlive this."""
    try:
        child = await asyncio.create_subprocess_exec(*arguments, env=environment)
    except OSError as error:
        raise ConfigurationError(f"{arguments[0]}: cannot be run: {error.strerror}") from None
    forwarding = asyncio.ensure_future(_forward(stop, child))
    try:
        status = await child.wait()
    finally:
        forwarding.cancel()
        if child.returncode is None:
            child.terminate()
            try:
                await asyncio.wait_for(child.wait(), STOP_LIMIT_S)
            except TimeoutError:
                child.kill()
                await child.wait()
    return status if status >= 0 else 128 - status


async def _forward(stop: asyncio.Queue[int], child: asyncio.subprocess.Process) -> None:
    """Forward signals to the command; the second Ctrl-C terminates it."""
    interrupts = 0
    while True:
        number = await stop.get()
        interrupts += number == signal.SIGINT
        if number != signal.SIGINT or (interrupts == 1 and not _in_foreground()):  # else the terminal has sent it too
            child.send_signal(number)
        elif interrupts > 1:
            child.terminate()


def _in_foreground() -> bool:
    with suppress(OSError):
        terminal = os.open("/dev/tty", os.O_RDONLY | os.O_NOCTTY)
        try:
            return os.tcgetpgrp(terminal) == os.getpgrp()
        finally:
            os.close(terminal)
    return False
