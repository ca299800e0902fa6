"""The `device emulate` command: connects an emulated device to a port, and obeys fault commands until the end."""

import asyncio
import json
import os
import selectors
import signal
import stat
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from difflib import get_close_matches
from functools import partial
from pathlib import Path
from time import monotonic
from typing import Any, TextIO

import yaml

from weberlink.config import ConfigurationError
from weberlink.config.document import override
from weberlink.config.errors import validated
from weberlink.hardware.emulator import EMULATORS, WireFaults
from weberlink.hardware.fault import HardwareFault
from weberlink.master.devices import DEVICES, LEADERS
from weberlink.order import COMPLETED, FAILED, STOP_SIGNALS
from weberlink.realtime.process import prepare
from weberlink.testing.serving import PtyDevice, ServedDevice
from weberlink_devices.umockdev import Testbed, TestbedNode

PORT = "{port}"  # placeholder for the port in the arguments of the command
PRIORITY = 60  # above the daemons, since a real device has its own processor
LOOK_S = 0.2  # period of checking that the emulator still runs
STOP_LIMIT_S = 3.0  # time from SIGTERM to SIGKILL
CHUNK = 4096
OF_THE_KERNEL = ("hid", "evdev")  # transports of devices that only a command in their testbed sees


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

    Returns the exit status of the command; without a command 0, or 1 if the emulator failed. Raises ConfigurationError
    if an argument is wrong, or umockdev is missing for a device of the kernel.
    """
    emulator = _build(name, overrides)
    if emulator.transport in OF_THE_KERNEL and not command:
        raise ConfigurationError(f"{name}: this device is visible to one command only; give it: -- COMMAND...")
    if emulator.transport != "serial" and link is not None:
        raise ConfigurationError(f"--link: the path of this device cannot be chosen; omit it for {name}")

    async def emulate() -> int:
        stop: asyncio.Queue[int] = asyncio.Queue()
        for number in STOP_SIGNALS:
            if signal.getsignal(number) is not signal.SIG_IGN:  # ignored by nohup, for example, it stays ignored
                asyncio.get_running_loop().add_signal_handler(number, stop.put_nowait, number)
        with ExitStack() as stack:
            device, port, environment = _connect(stack, name, emulator, link)
            commands = FaultCommands(name, emulator, device, out)
            sources = [] if faults is None else [stack.enter_context(fifo(faults))]
            if source is not None and not command:
                # Reading from a terminal in the background must not stop this process.
                stack.callback(signal.signal, signal.SIGTTIN, signal.signal(signal.SIGTTIN, signal.SIG_IGN))
                sources.append(source.fileno())
            section = "master.device" if name in DEVICES or name in LEADERS else "slave.robot"
            settings = yaml.safe_dump({"driver": name, "port": port}, default_flow_style=True, width=sys.maxsize)
            commands.say(f"{name} is at {port}; configure it as {section}: {settings.strip()}")
            arguments = [argument.replace(PORT, port) for argument in command]
            end = _run_command(arguments, environment, stop) if command else _until_stopped(stop)
            ends = [end, _until_failed(device), *(_execute_lines(each, commands) for each in sources)]
            tasks = [asyncio.ensure_future(each) for each in ends]
            try:
                done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
                results = [task.result() for task in done]  # raises what one of them has raised
                return results[0]
            finally:
                for task in tasks:
                    task.cancel()
                await asyncio.gather(*tasks, return_exceptions=True)

    # The default selector cannot wait for a regular file, such as a redirected standard input.
    with asyncio.Runner(loop_factory=lambda: asyncio.SelectorEventLoop(selectors.SelectSelector())) as runner:
        return runner.run(emulate())


def _build(name: str, overrides: Sequence[str]) -> Any:
    """The emulator of a driver."""
    try:
        emulator_class = EMULATORS.load(name)
    except ValueError as error:
        raise ConfigurationError(str(error)) from None
    content: dict[str, Any] = {}
    for text in overrides:
        override(content, text)
    try:
        return emulator_class(validated(emulator_class.Options, content))
    except ConfigurationError as error:
        raise ConfigurationError(f"--set {error}") from None


def _connect(stack: ExitStack, name: str, emulator: Any, link: Path | None) -> tuple[ServedDevice, str, dict[str, str]]:
    """The device, its port, and the environment of processes that use it."""
    hurry = partial(prepare, PRIORITY, lock_memory=False, cpu=None)  # the thread that answers for the device
    verb = "plugged in" if emulator.transport in OF_THE_KERNEL else "served"
    try:
        if emulator.transport == "serial":
            port = Path.cwd() / (link or f"weberlink-{name}")
            if port.is_symlink() and port.readlink().is_relative_to("/dev/pts") and not port.exists():
                port.unlink()  # a process that was killed left it there
            return stack.enter_context(PtyDevice(emulator, port, begin=hurry)), str(port), dict(os.environ)
        if emulator.transport in OF_THE_KERNEL:
            testbed = stack.enter_context(Testbed(PRIORITY))
            node = stack.enter_context(TestbedNode(testbed, emulator, begin=hurry))
            return node, node.node, testbed.environment
        device = stack.enter_context(emulator.served(hurry))
        return device, device.address, dict(os.environ)
    except FileExistsError as error:
        raise ConfigurationError(f"{error.filename2}: exists already; choose another with --link") from None
    except OSError as error:
        what = f"{error.filename2 or link}: cannot be created" if emulator.transport == "serial" else None
        raise ConfigurationError(f"{what or f'{name}: cannot be {verb}'}: {error.strerror}") from None
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


async def _until_stopped(stop: asyncio.Queue[int]) -> int:
    await stop.get()
    return COMPLETED


async def _until_failed(device: ServedDevice) -> int:
    while not device.plugged or device.serving:
        await asyncio.sleep(LOOK_S)
    return FAILED


async def _execute_lines(descriptor: int, commands: "FaultCommands") -> int:
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


class FaultCommands:
    """Interprets lines of commands: faults of the wire and of the device, its status, help; answers go to `out`."""

    def __init__(self, name: str, emulator: Any, device: ServedDevice, out: TextIO) -> None:
        self._name, self._emulator, self._device, self._out = name, emulator, device, out
        faults: WireFaults = emulator.faults
        self._words: Mapping[str, tuple[str, Callable[[float], object]]] = {
            "garble": (
                "as many of the next answers arrive with a byte changed; on a WebSocket: cut in half",
                lambda value: setattr(faults, "garble", int(_at_least_0(value))),
            ),
            "late": ("every answer is delayed by as many seconds", lambda s: setattr(faults, "late_s", _at_least_0(s))),
            "silent": ("answers are lost", lambda value: setattr(faults, "silent", value != 0.0)),
            "ok": ("end these three faults", lambda _: vars(faults).update(vars(WireFaults()))),
            "unplug": ("disconnect the device; one with its own power goes on", lambda _: device.unplug()),
            "plug": ("connect it again", lambda _: None if device.plugged else device.plug()),
            **{word: (what, partial(emulator.inject, word)) for word, what in emulator.OWN_FAULTS.items()},
            "status": ("print the state of the device as JSON", lambda _: self.say(json.dumps(self.status()))),
            "help": ("list the commands", lambda _: self.say(helped)),
        }
        width = max(map(len, self._words))
        helped = "\n".join(f"{word:{width}}  {what}" for word, (what, _) in self._words.items())
        helped += "\na number may follow a fault; the default is 1"

    def say(self, text: str) -> None:
        with suppress(BrokenPipeError):  # nobody reads the answers
            self._out.write(text + "\n")
            self._out.flush()

    def execute(self, line: str) -> None:
        """Execute a command; a wrong one is answered with the reason."""
        word, *values = line.split() or [""]
        try:
            if word in self._words:
                self._words[word][1](float(" ".join(values)) if values else 1.0)
            elif word:
                close = get_close_matches(word, self._words, n=1, cutoff=0.5)
                known = f"did you mean {close[0]}?" if close else f"there are {', '.join(self._words)}"
                self.say(f"{word}: unknown; {known}")
        except (ValueError, OSError, HardwareFault) as error:
            said = str(error)
            self.say(said if said.startswith(f"{word}:") else f"{word}: {said}")

    def status(self) -> dict[str, Any]:
        """State of the device: the public attributes and properties of its emulator that are plain values."""
        emulator = self._emulator
        if not self._device.plugged:  # its port does not advance it
            emulator.advance(monotonic())
        properties = [
            name for each in type(emulator).__mro__ for name, it in vars(each).items() if isinstance(it, property)
        ]
        public = {name for name in (*vars(emulator), *properties) if not name.startswith("_")}
        values = {name: getattr(emulator, name) for name in sorted(public)}
        return {
            "name": self._name,
            "plugged": self._device.plugged,
            "now": monotonic(),
            "faults": dict(vars(emulator.faults)),
            **{name: value for name, value in values.items() if _is_plain(value)},
        }


def _is_plain(value: Any) -> bool:
    if type(value) in (tuple, list):
        return all(map(_is_plain, value))
    if isinstance(value, float):
        return value - value == 0.0
    return value is None or isinstance(value, bool | int | str)


def _at_least_0(value: float) -> float:
    if not 0.0 <= value < 1e9:
        raise ValueError(f"expected a number >= 0, got {value}")
    return value
